"""The registration keeper: after a restart of the name server it registers all open ports again."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import threading
from typing import TYPE_CHECKING

import pytest

from rtf import clock
from rtf.bottle import Bottle
from rtf.middleware.errors import ConnectError
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.naming.registration_keeper import Record, RegistrationKeeper
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

_PROGRAM = "import sys; from rtf.cli.network.name_server import nameserver; sys.exit(nameserver(sys.argv[1:]))"


class Program:
    """``rtf nameserver`` as a process that can be killed and started again at the same address.

    While it is not there, its port may be that of any connection from 127.0.0.1; none comes from this address.
    """

    def __init__(self, folder: Path) -> None:
        self._environment = {**os.environ, "YARP_CONFIG_HOME": str(folder)}
        self._number = "0"
        self.contact = Contact()
        self.start()

    def start(self) -> None:
        """Start the server, at its former address."""
        words = [sys.executable, "-c", _PROGRAM, "--ip", "127.77.0.1", "--socket", self._number, "--no-discovery"]
        self._process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=self._environment)
        assert self._process.stdout is not None
        said = self._process.stdout.readline()
        found = re.search(r"available at ip (\S+) port (\d+)", said)
        assert found, said
        self._number = found[2]
        self.contact = Contact("/root", found[1], int(found[2]), "tcp")

    def kill(self) -> None:
        """Kill the server with SIGKILL."""
        self._process.send_signal(signal.SIGKILL)
        self._process.wait(10)
        assert self._process.stdout is not None
        self._process.stdout.close()


@pytest.fixture
def program(nothing_left: None, tmp_path: Path) -> Iterator[Program]:
    """A server in a process of its own."""
    running = Program(tmp_path)
    yield running
    running.kill()


def test_killed_and_restarted_under_load(program: Program, wait_until: Callable[..., None]):
    """After a kill of the server, under load, all open ports are registered again and can be used."""
    names = RemoteNames(program.contact, watch=0.1)
    network = Network(names)
    stop, opened, failed = threading.Event(), [0], [0]

    def churn(who: int) -> None:
        """Open and close ports in turn; opening fails while there is no server."""
        while not stop.is_set():
            try:
                with Port(f"/churn/{who}", network=network):
                    opened[0] += 1
            except ConnectError:
                failed[0] += 1
                stop.wait(0.01)

    threads = [threading.Thread(target=churn, args=(who,)) for who in range(3)]
    got: list[int] = []
    with contextlib.ExitStack() as stack:
        stack.callback(stop.set)  # also if something fails
        readers = [
            stack.enter_context(Port(f"/reader/{index}", lambda delivery: got.append(1), network=network))
            for index in range(20)
        ]
        writer = stack.enter_context(Port("/writer", network=network, promise="yarp/bottle"))
        writer.add_output("/reader/0")
        names.set_property("/writer", "mine", ["kept"])
        for thread in threads:
            thread.start()
        wait_until(lambda: opened[0] > 10, "nothing was opened")
        program.kill()
        wait_until(lambda: failed[0] > 10, "nobody noticed")
        writer.write(Bottle(["still connected"]))
        assert got == [1]
        program.start()
        other = RemoteNames(program.contact)  # knows nothing itself
        wait_until(lambda: len(other.list("/reader")) == 20 and other.query("/writer"), "not all are back")
        assert [other.query(reader.name) for reader in readers] == [reader.contact for reader in readers]
        wait_until(lambda: list(other.get_property("/writer", "mine")) == ["kept"], "the note is not back")
        assert list(other.get_property("/writer", "type")) == ["yarp/bottle"]
        assert list(other.get_property("/writer", "process")) == [str(os.getpid())]
        writer.add_output("/reader/7")
        writer.write(Bottle(["and again"]))
        before = opened[0]
        wait_until(lambda: opened[0] > before + 10, "nothing can be opened any more")
        stop.set()
        for thread in threads:
            thread.join(10)
            assert not thread.is_alive()
    assert other.list("/reader") == []
    other.close()


def test_persistent_connections_come_back(program: Program, wait_until: Callable[..., None]):
    """Ports are announced again, so that a new server makes persistent connections."""
    names = RemoteNames(program.contact, watch=0.05)
    network = Network(names)
    with Port("/reader", network=network), Port("/writer", network=network) as writer:
        program.kill()
        program.start()
        RemoteNames(program.contact).command("subscribe /writer /reader")
        wait_until(lambda: writer.outputs, "not connected")


def test_a_name_that_another_took_is_his(names: RemoteNames, server: NameServer, wait_until: Callable[..., None]):
    """A name that another process has registered is neither taken back nor kept any more."""
    names.register("/a", host="127.0.0.1", port=20001)
    names.register("/b", host="127.0.0.1", port=20002)
    server.names.register("/a", host="127.0.0.1", port=30001)
    server.names.unregister("/b")
    wait_until(lambda: server.names.query("/b"), "/b is not back")
    wait_until(lambda: "/a" not in names._keeper._records, "/a is still looked after")
    assert server.names.query("/a").port == 30001


def test_what_was_given_up_does_not_come_back(names: RemoteNames, server: NameServer, wait_until: Callable[..., None]):
    """An unregistered name stays unregistered, also if the keeper is at work meanwhile."""
    names.register("/stays", host="127.0.0.1", port=20001)
    for _ in range(100):
        names.register("/a", host="127.0.0.1", port=20002)
        server.names.unregister("/a")
        server.names.unregister("/stays")
        names.unregister("/a")
    wait_until(lambda: server.names.query("/stays"), "/stays is not back")
    assert server.names.query("/a") is None


def test_announced_when_it_can_be_heard(nothing_left: None, wait_until: Callable[..., None]):
    """An announcement that the server missed is repeated to the next one; that of an unknown port is an error."""
    with NameServer() as first:
        names = RemoteNames(first.contact, watch=0.05)
        names.register("/a", host="127.0.0.1", port=20001)
    names.announce("/a")
    with pytest.raises(ConnectError):
        names.announce("/b")
    with NameServer(port=first.contact.port) as second:
        wait_until(lambda: second.names.query("/a"), "/a is not back")
        second.names.command("register /b")
        wait_until(lambda: not names._keeper._records["/a"].announcement_missing, "its announcement is still missing")
        second.names.command("unregister /a")
        names.close()


def test_an_announcement_that_fails_while_its_name_is_restored(nothing_left: None, wait_until: Callable[..., None]):
    """An announcement that another thread makes in vain meanwhile is repeated, too."""
    restored: list[bool] = []

    def restore(record: Record) -> None:
        restored.append(record.announced)
        if len(restored) == 1:
            keeper.announced("/a", heard=False)

    contact = Contact("/a", "127.0.0.1", 20001)
    keeper = RegistrationKeeper(lambda _: contact if restored else None, restore, 0.01)
    keeper.keep(Record(contact))
    with contextlib.closing(keeper):
        wait_until(lambda: restored == [False, True], "it is not announced")


def test_a_name_that_comes_while_the_keeper_is_closed(nothing_left: None, wait_until: Callable[..., None]):
    """``close`` ends, and the keeper's thread, although another thread opens a port meanwhile."""
    asked, may_answer = threading.Event(), threading.Event()

    def find(name: str) -> Contact:
        asked.set()
        assert may_answer.wait(10)
        return Contact(name, "127.0.0.1", 20001)

    keeper = RegistrationKeeper(find, lambda _: None, 0.01)
    keeper.keep(Record(Contact("/a", "127.0.0.1", 20001)))
    assert asked.wait(10)
    closer = threading.Thread(target=keeper.close)
    closer.start()
    wait_until(lambda: not keeper._records, "it does not close")
    keeper.keep(Record(Contact("/b", "127.0.0.1", 20001)))
    may_answer.set()
    closer.join(10)
    ended = not closer.is_alive()
    keeper.close()
    assert ended


def test_no_thread_without_ports(names: RemoteNames, wait_until: Callable[..., None]):
    """The keeper's thread starts with the first port, and ends with the last."""
    others = {*threading.enumerate()}

    def watching() -> bool:
        return any(thread.name == "rtf-names" for thread in {*threading.enumerate()} - others)

    names.query("/a")
    assert not watching()
    for _ in range(3):
        names.register("/a")
        names.register("/b")
        assert watching()
        names.unregister("/a")
        names.unregister("/b")
        wait_until(lambda: not watching(), "it still watches")


def test_costs_next_to_nothing(server: NameServer):
    """Keeping a hundred ports takes less than 1 % of a processor, of client and server together."""
    names = RemoteNames(server.contact, watch=0.05)
    for index in range(100):
        names.register(f"/{index}", host="127.0.0.1", port=20001)
    before = os.times()
    clock.sleep(1.0)  # what is measured is a rate
    after = os.times()
    names.close()
    used = after.user + after.system - before.user - before.system
    assert used * 0.05 / 2.0 < 0.01, "at the period of two seconds that is the default"


def test_a_server_that_is_away_is_not_asked_often(nothing_left: None):
    """Without a server the keeper asks once a period, at little cost."""
    with NameServer() as server:
        names = RemoteNames(server.contact, watch=0.05)
        names.register("/a", host="127.0.0.1", port=20001)
    before = os.times()
    clock.sleep(0.5)
    after = os.times()
    assert after.user + after.system - before.user - before.system < 0.25
    names.close()
