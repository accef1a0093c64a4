"""What everybody who keeps names promises: one set of tests for all of them."""

from __future__ import annotations

import socket
from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest

from rtf.bottle import Bottle
from rtf.middleware.errors import AddressError, ConnectError
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.naming.multi_server import MultiServerNames
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.ports.names import Names


class NamesContract:
    """Subclasses give the names."""

    @pytest.fixture
    def names(self, nothing_left: None) -> Iterator[Names]:
        """The names under test."""
        raise NotImplementedError

    def test_a_registered_name_is_found(self, names: Names):
        """What was registered is what is answered, field by field."""
        there = names.register("/a", carrier="tcp", host="127.0.0.1", port=20001, promise="yarp/image")
        assert (there.name, there.host, there.port, there.carrier) == ("/a", "127.0.0.1", 20001, "tcp")
        assert names.query("/a") == there

    def test_what_is_left_out_is_chosen(self, names: Names):
        """Carrier and host are filled in."""
        there = names.register("/a")
        assert (there.name, there.host, there.carrier) == ("/a", "127.0.0.1", "tcp")

    def test_the_nameless_get_names(self, names: Names):
        """They differ."""
        first, second = names.register(""), names.register("")
        assert first.name.startswith("/tmp/port/")
        assert second.name.startswith("/tmp/port/")
        assert first.name != second.name

    def test_registering_again_replaces(self, names: Names):
        """The place is the new one, and what was noted about the old one is gone."""
        names.register("/a", host="127.0.0.1", port=20001)
        names.set_property("/a", "k", ["v"])
        names.register("/a", host="127.0.0.1", port=20002)
        found = names.query("/a")
        assert found is not None
        assert found.port == 20002
        assert list(names.get_property("/a", "k")) == []

    def test_an_unregistered_name_is_forgotten(self, names: Names):
        """So is what was noted about it; unregistering again is no error."""
        names.register("/a")
        names.set_property("/a", "k", ["v"])
        for _ in range(2):
            names.unregister("/a")
        assert names.query("/a") is None
        assert list(names.get_property("/a", "k")) == []

    def test_what_a_port_owns_goes_with_it(self, names: Names):
        """And what that owns, too."""
        for name in "/a", "/b", "/c":
            names.register(name)
        names.set_property("/a", "owns", ["/b"])
        names.set_property("/b", "owns", ["/c", "/a"])
        names.unregister("/a")
        assert [names.query(name) for name in ("/a", "/b", "/c")] == [None, None, None]

    def test_lists_by_whole_parts_of_names(self, names: Names):
        """A prefix is a name, or the beginning of one up to a slash; the order is that of the names."""
        for name in "/re/b", "/reader", "/re", "/re/a":
            names.register(name)
        assert [contact.name for contact in names.list("/re")] == ["/re", "/re/a", "/re/b"]
        assert [contact.name for contact in names.list("/re/")] == ["/re/a", "/re/b"]
        everything = [contact.name for contact in names.list()]
        assert [name for name in everything if name.startswith("/re")] == ["/re", "/re/a", "/re/b", "/reader"]
        assert everything == sorted(everything)

    def test_notes_are_sets(self, names: Names):
        """They replace each other, come back sorted and once each, and none means forgotten."""
        names.register("/a")
        names.set_property("/a", "ips", ["127.0.0.1", "10.0.0.1", "127.0.0.1", "two words", "::1"])
        assert list(names.get_property("/a", "ips")) == ["10.0.0.1", "127.0.0.1", "::1", "two words"]
        names.set_property("/a", "ips", ["x"])
        assert list(names.get_property("/a", "ips")) == ["x"]
        names.set_property("/a", "ips", [])
        assert list(names.get_property("/a", "ips")) == []

    def test_nothing_is_noted_about_strangers(self, names: Names):
        """Nor is it an error."""
        names.set_property("/nobody", "k", ["v"])
        assert list(names.get_property("/nobody", "k")) == []

    @pytest.mark.parametrize("name", ["/a b", "/a\tb", '/a"b', "/" + 1000 * "x"])
    def test_names_that_no_answer_can_hold_are_refused(self, names: Names, name: str):
        """The error says so, and nothing is registered."""
        with pytest.raises(AddressError, match="no blanks"):
            names.register(name)
        assert all(contact.name != name for contact in names.list())

    def test_commands_are_answered_in_lines(self, names: Names):
        """With the end line, if there is one."""
        names.register("/a", host="127.0.0.1", port=20001)
        known = "registration name /a ip 127.0.0.1 port 20001 type tcp"
        assert list(names.command("query /a")) == [known, "*** end of message"]
        assert list(names.command("announce /a")) == ["[ok]"]
        assert list(names.command("bot query /nobody")) == ['port (error -2 "port not known")']
        assert list(names.command("subscribe")) == ["subscriptions"]

    def test_ports_meet_through_them(self, names: Names):
        """A port that is opened is found by another."""
        network = Network(names)
        got: list[str] = []
        with (
            Port("/in", lambda delivery: got.append(delivery.read().to_text()), network=network) as reader,
            Port("/out", network=network) as writer,
        ):
            assert names.query("/in") == reader.contact
            writer.add_output("/in")
            writer.write(Bottle(["hello"]))
            assert got == ["hello"]
        assert names.query("/in") is None

    def test_a_number_that_is_taken_is_no_obstacle(self, names: Names):
        """Somebody who never asked for it listens there: the port takes another number, and says so."""
        with socket.create_server(("127.0.0.1", 0)) as squatter:
            number = squatter.getsockname()[1]
            names.register("/a", host="127.0.0.1", port=number)
            with Port("/a", network=Network(_Insisting(names, number))) as port:
                assert port.contact.port != number
                assert names.query("/a") == port.contact


class _Insisting(LocalNames):
    """Hands out one number first, and passes everything on."""

    def __init__(self, names: Names, number: int) -> None:
        super().__init__()
        self._names, self._number = names, number

    def register(self, name: str, *, carrier: str = "", host: str = "", port: int = 0, promise: str = ""):
        """See Names."""
        number, self._number = port or self._number, 0
        return self._names.register(name, carrier=carrier, host=host, port=number, promise=promise)

    def unregister(self, name: str) -> None:
        """See Names."""
        self._names.unregister(name)


class TestLocal(NamesContract):
    """In this process alone."""

    @pytest.fixture
    def names(self) -> Names:
        """See NamesContract."""
        return LocalNames()


class TestInside(NamesContract):
    """A server, asked from within its process."""

    @pytest.fixture
    def names(self, nothing_left: None) -> Iterator[Names]:
        """See NamesContract."""
        with NameServer() as server:
            yield server.names


class TestRemote(NamesContract):
    """A server, asked over the network."""

    @pytest.fixture
    def names(self, nothing_left: None) -> Iterator[Names]:
        """See NamesContract."""
        with NameServer() as server:
            client = RemoteNames(server.contact, watch=0.05)
            yield client
            client.close()


class TestSeveral(NamesContract):
    """Two servers at once."""

    @pytest.fixture
    def names(self, nothing_left: None) -> Iterator[Names]:
        """See NamesContract."""
        with ExitStack() as stack:
            servers = [stack.enter_context(NameServer(namespace=name)) for name in ("/one", "/two")]
            client = MultiServerNames([RemoteNames(server.contact, watch=0.05) for server in servers])
            yield client
            client.close()

    def test_each_of_them_knows(self, names: MultiServerNames):
        """What one registers is the same for all, and they list their own, too."""
        there = names.register("/a")
        assert [one.query("/a") for one in names._all] == [there, there]
        assert [contact.name for contact in names.list("/one")] == ["/one"]
        assert [contact.name for contact in names.list("/two")] == ["/two"]
        names._all[0].unregister("/a")
        assert names.query("/a") == there, "the other one is asked"

    def test_one_that_is_away(self, nothing_left: None):
        """The others still tell what they know, and forget; but no port is opened that only some would know."""
        with NameServer(namespace="/two") as two:
            with NameServer(namespace="/one") as one:
                names = MultiServerNames([RemoteNames(server.contact, watch=60) for server in (one, two)])
                there = names.register("/a")
            assert names.query("/a") == there
            assert list(names.get_property("/a", "process"))
            for fails in (lambda: names.query("/b"), names.list, lambda: names.register("/b")):
                with pytest.raises(ConnectError, match=str(one.contact.port)):
                    fails()
            with pytest.raises(ConnectError):
                names.unregister("/a")
            assert two.names.query("/a") is None
            other_way = MultiServerNames([*reversed(names._all)])
            with pytest.raises(ConnectError):
                other_way.register("/c")
            assert two.names.query("/c") is None
            names.close()
