"""The contract of ``Names``: one class of tests for all implementations."""

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
    """The tests; subclasses provide the names."""

    @pytest.fixture
    def names(self, nothing_left: None) -> Iterator[Names]:
        """The names under test."""
        raise NotImplementedError

    def test_a_registered_name_is_found(self, names: Names):
        """A query returns all fields of the registration."""
        there = names.register("/a", carrier="tcp", host="127.0.0.1", port=20001, promise="yarp/image")
        assert (there.name, there.host, there.port, there.carrier) == ("/a", "127.0.0.1", 20001, "tcp")
        assert names.query("/a") == there

    def test_what_is_left_out_is_chosen(self, names: Names):
        """A registration without host and carrier gets this machine and tcp."""
        there = names.register("/a")
        assert (there.name, there.host, there.carrier) == ("/a", "127.0.0.1", "tcp")

    def test_the_nameless_get_names(self, names: Names):
        """Each registration without a name gets a unique one."""
        first, second = names.register(""), names.register("")
        assert first.name.startswith("/tmp/port/")
        assert second.name.startswith("/tmp/port/")
        assert first.name != second.name

    def test_registering_again_replaces(self, names: Names):
        """A second registration replaces the contact, and removes the properties."""
        names.register("/a", host="127.0.0.1", port=20001)
        names.set_property("/a", "k", ["v"])
        names.register("/a", host="127.0.0.1", port=20002)
        found = names.query("/a")
        assert found is not None
        assert found.port == 20002
        assert list(names.get_property("/a", "k")) == []

    def test_an_unregistered_name_is_forgotten(self, names: Names):
        """Unregistering removes contact and properties; repeating it is no error."""
        names.register("/a")
        names.set_property("/a", "k", ["v"])
        for _ in range(2):
            names.unregister("/a")
        assert names.query("/a") is None
        assert list(names.get_property("/a", "k")) == []

    def test_what_a_port_owns_goes_with_it(self, names: Names):
        """Unregistering a port unregisters the ports that it owns, and theirs."""
        for name in "/a", "/b", "/c":
            names.register(name)
        names.set_property("/a", "owns", ["/b"])
        names.set_property("/b", "owns", ["/c", "/a"])
        names.unregister("/a")
        assert [names.query(name) for name in ("/a", "/b", "/c")] == [None, None, None]

    def test_lists_by_whole_parts_of_names(self, names: Names):
        """A list is sorted, and its prefix matches whole parts of names."""
        for name in "/re/b", "/reader", "/re", "/re/a":
            names.register(name)
        assert [contact.name for contact in names.list("/re")] == ["/re", "/re/a", "/re/b"]
        assert [contact.name for contact in names.list("/re/")] == ["/re/a", "/re/b"]
        everything = [contact.name for contact in names.list()]
        assert [name for name in everything if name.startswith("/re")] == ["/re", "/re/a", "/re/b", "/reader"]
        assert everything == sorted(everything)

    def test_notes_are_sets(self, names: Names):
        """The values of a property are a sorted set that replaces the former; none removes the property."""
        names.register("/a")
        names.set_property("/a", "ips", ["127.0.0.1", "10.0.0.1", "127.0.0.1", "two words", "::1"])
        assert list(names.get_property("/a", "ips")) == ["10.0.0.1", "127.0.0.1", "::1", "two words"]
        names.set_property("/a", "ips", ["x"])
        assert list(names.get_property("/a", "ips")) == ["x"]
        names.set_property("/a", "ips", [])
        assert list(names.get_property("/a", "ips")) == []

    def test_nothing_is_noted_about_strangers(self, names: Names):
        """Setting a property of an unknown name is ignored."""
        names.set_property("/nobody", "k", ["v"])
        assert list(names.get_property("/nobody", "k")) == []

    @pytest.mark.parametrize("name", ["/a b", "/a\tb", '/a"b', "/" + 1000 * "x"])
    def test_names_that_no_answer_can_hold_are_refused(self, names: Names, name: str):
        """A name with blanks or quotes, or a too long one, is refused."""
        with pytest.raises(AddressError, match="no blanks"):
            names.register(name)
        assert all(contact.name != name for contact in names.list())

    def test_commands_are_answered_in_lines(self, names: Names):
        """``command`` returns the lines of the answer, with the end line if it has one."""
        names.register("/a", host="127.0.0.1", port=20001)
        known = "registration name /a ip 127.0.0.1 port 20001 type tcp"
        assert list(names.command("query /a")) == [known, "*** end of message"]
        assert list(names.command("announce /a")) == ["[ok]"]
        assert list(names.command("bot query /nobody")) == ['port (error -2 "port not known")']
        assert list(names.command("subscribe")) == ["subscriptions"]

    def test_ports_meet_through_them(self, names: Names):
        """A port is registered while it is open, and another port connects to it by name."""
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
        """A port whose number is in use takes another one, and registers it."""
        with socket.create_server(("127.0.0.1", 0)) as squatter:
            number = squatter.getsockname()[1]
            names.register("/a", host="127.0.0.1", port=number)
            with Port("/a", network=Network(_Insisting(names, number))) as port:
                assert port.contact.port != number
                assert names.query("/a") == port.contact


class _Insisting(LocalNames):
    """Names that return one given number first, and else behave as the wrapped ones."""

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
    """Names of this process alone."""

    @pytest.fixture
    def names(self) -> Names:
        """See NamesContract."""
        return LocalNames()


class TestInside(NamesContract):
    """The names of a server in the same process."""

    @pytest.fixture
    def names(self, nothing_left: None) -> Iterator[Names]:
        """See NamesContract."""
        with NameServer() as server:
            yield server.names


class TestRemote(NamesContract):
    """The names of a server, over the network."""

    @pytest.fixture
    def names(self, nothing_left: None) -> Iterator[Names]:
        """See NamesContract."""
        with NameServer() as server:
            client = RemoteNames(server.contact, watch=0.05)
            yield client
            client.close()


class TestSeveral(NamesContract):
    """The names of two servers together."""

    @pytest.fixture
    def names(self, nothing_left: None) -> Iterator[Names]:
        """See NamesContract."""
        with ExitStack() as stack:
            servers = [stack.enter_context(NameServer(namespace=name)) for name in ("/one", "/two")]
            client = MultiServerNames([RemoteNames(server.contact, watch=0.05) for server in servers])
            yield client
            client.close()

    def test_each_of_them_knows(self, names: MultiServerNames):
        """A registration reaches all servers, lists join theirs, and a name is found if one server knows it."""
        there = names.register("/a")
        assert [one.query("/a") for one in names._all] == [there, there]
        assert [contact.name for contact in names.list("/one")] == ["/one"]
        assert [contact.name for contact in names.list("/two")] == ["/two"]
        names._all[0].unregister("/a")
        assert names.query("/a") == there, "the other one is asked"

    def test_one_that_is_away(self, nothing_left: None):
        """Without one server, known names are found and removed at the others; new registrations fail."""
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
