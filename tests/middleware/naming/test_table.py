"""The table of names: its limits, and its file."""

from __future__ import annotations

import sqlite3
import threading
from pathlib import Path

import pytest

from rtf.bottle import Bottle
from rtf.middleware.errors import AddressError, MiddlewareError
from rtf.middleware.naming import table as module
from rtf.middleware.naming.commands import Commands
from rtf.middleware.naming.pools import Numbers
from rtf.middleware.naming.store import Database
from rtf.middleware.naming.subscriptions import Subscriptions
from rtf.middleware.naming.table import Table
from rtf.middleware.wire.contact import Contact


def port(table: Table, name: str, number: int = 0) -> int:
    """Register a port of this machine, and return its number."""
    return table.register(name, "tcp", "127.0.0.1", number).port


class TestBounds:
    """The table has limits, because any program may register."""

    def test_ports(self, monkeypatch: pytest.MonkeyPatch):
        """Beyond MAX_PORTS only known names can register again."""
        monkeypatch.setattr(module, "MAX_PORTS", 3)
        table = Table()
        for name in "/a", "/b", "/c", "/a":
            port(table, name)
        with pytest.raises(AddressError, match="rtf clean"):
            port(table, "/d")
        assert [contact.name for contact in table.list()] == ["/a", "/b", "/c"]

    def test_notes(self, monkeypatch: pytest.MonkeyPatch):
        """Properties have a total size; a refused value changes nothing, and removing values makes room."""
        monkeypatch.setattr(module, "MAX_NOTED", 100)
        table = Table()
        port(table, "/a")
        assert table.set("/a", "k", ["x" * 90])
        for key, value in ("k", "y" * 101), ("other", "z" * 20):
            with pytest.raises(AddressError, match="too large"):
                table.set("/a", key, [value])
        assert table.get("/a", "k") == ("x" * 90,)
        assert table.get("/a", "other") == ()
        table.set("/a", "k", [])
        assert table.set("/a", "other", ["z" * 20])
        table.unregister("/a")
        port(table, "/b")
        assert table.set("/b", "k", ["x" * 99])

    def test_one_note(self):
        """A single value has a greatest size."""
        table = Table()
        port(table, "/a")
        with pytest.raises(AddressError):
            table.set("/a", "k", ["x" * 5000])

    @pytest.mark.parametrize("number", [-1, 65536, 2**31])
    def test_numbers(self, number: int):
        """A number that no port can have is refused."""
        with pytest.raises(AddressError, match="65535"):
            port(Table(), "/a", number)

    @pytest.mark.parametrize("host", ["no host", "a..b", "x" * 64, ".a", "é", "10.0.0.1:5", "[::1]", "a\n"])
    def test_hosts(self, host: str):
        """An invalid host name is refused."""
        with pytest.raises(AddressError, match="is not a host"):
            Table().register("/a", "tcp", host, 5)

    def test_a_refused_name_changes_nothing(self):
        """A refused registration allocates no number."""
        table = Table(Numbers(1, 9))
        with pytest.raises(AddressError):
            table.register("/a", "tcp", "no host", 0)
        assert table.list() == []
        assert port(table, "/b") == 1


class TestNames:
    """Names that the server makes."""

    def test_of_nested_ones(self):
        """A name that begins with = gets a temporary name before it."""
        table = Table()
        assert table.register("=/topic", "tcp", "127.0.0.1", 1).name == "/tmp/port/1=/topic"

    def test_are_not_registered_yet(self):
        """A temporary name that is registered already is skipped."""
        table = Table()
        port(table, "/tmp/port/1", 5)
        assert table.register("", "tcp", "127.0.0.1", 1).name == "/tmp/port/2"
        assert table.query("/tmp/port/1").port == 5

    def test_are_used_again(self):
        """A temporary name is used again after its port is unregistered."""
        table = Table()
        table.register("...", "tcp", "127.0.0.1", 1)
        table.unregister("/tmp/port/1")
        assert table.register("...", "tcp", "127.0.0.1", 1).name == "/tmp/port/1"

    def test_multicast_groups(self):
        """Each multicast port gets a group, which is free again after the port is unregistered."""
        table = Table(Numbers(1, 99))
        first, second = (table.register("", "mcast", "", 0) for _ in range(2))
        assert [first.host, second.host] == ["224.1.1.3", "224.1.1.4"]
        table.unregister(first.name)
        assert table.register("", "mcast", "", 0).host == "224.1.1.3"

    def test_by_network(self):
        """A query with a network returns the port's address in it, or its usual one."""
        table = Table()
        port(table, "/a", 7)
        table.set("/a", "ips", ["127.0.0.1", "10.0.0.5", "192.168.1.4"])
        assert table.query("/a", "192.").host == "192.168.1.4"
        assert table.query("/a", "172.").host == "127.0.0.1"
        assert table.query("/a").host == "127.0.0.1"


class TestFile:
    """The file with all names, from which a restarted server reads them."""

    def test_everything_is_there(self, tmp_path: Path):
        """Ports, properties, numbers and temporary names survive, also without an orderly end."""
        path = tmp_path / "names.db"
        first = Table(Numbers(1, 99), Database(path))
        assert [port(first, name) for name in ("/a", "/b", "/gone")] == [1, 2, 3]
        first.register("", "mcast", "", 0)
        first.set("/a", "k", ["v", "w"])
        first.set("/a", "empty", [])
        first.unregister("/gone")
        known = first.list()
        first.store.close()
        second = Table(Numbers(1, 99), Database(path))
        assert second.list() == known
        assert second.get("/a", "k") == ("v", "w")
        assert port(second, "/new") == 5
        assert port(second, "/gone") == 3
        assert second.register("", "tcp", "127.0.0.1", 9).name == "/tmp/port/2"
        assert second.register("", "mcast", "", 0).host == "224.1.1.4"
        second.store.close()

    def test_belongs_to_one_server(self, tmp_path: Path):
        """A second server with the same file is an error with a hint."""
        first = Database(tmp_path / "names.db")
        first.put("port", "/a", {})
        with pytest.raises(MiddlewareError, match=r"names\.db .*move it out of the way"):
            Database(tmp_path / "names.db")
        first.close()

    def test_that_is_none(self, tmp_path: Path):
        """A file that is no database, and one in a missing folder, are refused."""
        (tmp_path / "names.db").write_bytes(b"garbage" * 1000)
        with pytest.raises(MiddlewareError, match=r"names\.db"):
            Database(tmp_path / "names.db")
        with pytest.raises(MiddlewareError, match="missing"):
            Database(tmp_path / "missing" / "names.db")

    def test_with_broken_values(self, tmp_path: Path):
        """A database with invalid JSON is refused."""
        Database(tmp_path / "names.db").close()
        with sqlite3.connect(tmp_path / "names.db") as connection:
            connection.execute("INSERT INTO names VALUES ('port', '/a', '{')")
        connection.close()
        store = Database(tmp_path / "names.db")
        with pytest.raises(MiddlewareError, match=r"names\.db"):
            Table(store=store)
        store.close()

    def test_that_cannot_be_written(self, tmp_path: Path):
        """A command whose change cannot be stored raises an error instead of returning an answer."""
        store = Database(tmp_path / "names.db")
        table = Table(Numbers(1, 99), store)
        commands = Commands(table, Subscriptions(table), Contact("/root", "127.0.0.1", 1, "tcp"))
        store._connection.execute("DROP TABLE names")
        for line in "register /a", "subscribe /a /b", "topic /t":
            with pytest.raises(MiddlewareError, match=r"names\.db cannot be stored"):
                commands.answer(Bottle.parse(line), "127.0.0.1")
        store.close()


def test_from_any_thread():
    """Threads may register and unregister at the same time: numbers stay unique, and counts right."""
    table = Table(Numbers(1, 9999))
    taken: list[int] = []

    def work(who: int) -> None:
        for index in range(200):
            taken.append(port(table, f"/{who}/{index}"))
            table.set(f"/{who}/{index}", "k", ["v"])
        for index in range(0, 200, 2):
            table.unregister(f"/{who}/{index}")

    threads = [threading.Thread(target=work, args=(who,)) for who in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(taken)) == len(taken) == 1600
    assert len(table.list()) == 800
    assert table._noted == 800 * 2
