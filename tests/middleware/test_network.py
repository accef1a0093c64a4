"""The network: it looks names up, and opens the addresses of ports."""

from __future__ import annotations

import socket

import pytest

from rtf.middleware.errors import AddressError, ConnectError
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network, Opening, listen
from rtf.middleware.ports.port import Port
from rtf.middleware.wire.contact import Contact


class Giving(LocalNames):
    """Names that register a port at this number, and count registrations."""

    def __init__(self, number: int, host: str = "127.0.0.1") -> None:
        super().__init__(host=host)
        self.number = number
        self.asked = 0

    def register(self, name: str, *, carrier: str = "", host: str = "", port: int = 0, promise: str = "") -> Contact:
        """See Names."""
        self.asked += 1
        return super().register(name, carrier=carrier, host=host, port=port or self.number, promise=promise)


@pytest.fixture
def squatter():
    """A socket that occupies a port number."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        yield listening


class TestResolve:
    """Looking up the address of a contact."""

    def test_a_name(self):
        """A name is looked up; the contact's carrier replaces the registered one."""
        names = LocalNames()
        there = names.register("/a", host="127.0.0.1", port=5, carrier="udp")
        network = Network(names)
        assert network.resolve(Contact("/a")) == there
        assert network.resolve(Contact("/a", carrier="tcp")) == there.by("tcp")
        assert network.resolve(Contact("/b")) is None

    def test_an_address(self):
        """An address is returned without a look-up."""
        contact = Contact.parse("tcp://127.0.0.1:5/a")
        assert Network(LocalNames()).resolve(contact) == contact

    def test_a_name_without_a_number(self):
        """A name that is registered without a port number is not found."""
        names = LocalNames()
        names.register("/a")
        assert Network(names).resolve(Contact("/a")) is None


class TestOpening:
    """The address at which a port listens."""

    def test_where_the_name_server_says(self):
        """A port listens at the number of the name server, and is registered once."""
        with listen("127.0.0.1", 0) as probe:
            number = probe.getsockname()[1]
        names = Giving(number)
        listening, contact = Network(names).open_address("/a")
        with listening:
            assert listening.getsockname() == ("127.0.0.1", number)
            assert contact == Contact("/a", "127.0.0.1", number, "tcp")
        assert names.asked == 1

    def test_elsewhere_when_that_is_taken(self, squatter: socket.socket):
        """If the number is in use, the port takes another one, and registers it with its type."""
        names = Giving(squatter.getsockname()[1])
        listening, contact = Network(names).open_address("/a", "yarp/image")
        with listening:
            assert listening.getsockname()[1] == contact.port != squatter.getsockname()[1]
            assert names.query("/a") == contact
            assert list(names.get_property("/a", "type")) == ["yarp/image"]

    def test_nowhere(self):
        """An address of another machine is an error, and the name is unregistered."""
        names = Giving(5, host="192.0.2.77")
        with pytest.raises(ConnectError, match=r"/a cannot listen on 192\.0\.2\.77: "):
            Network(names).open_address("/a")
        assert names.query("/a") is None

    def test_at_a_number_that_is_fixed(self, squatter: socket.socket):
        """A number of the environment is used, or is an error if it is in use."""
        number = squatter.getsockname()[1]
        names = LocalNames()
        network = Network(names, opening=lambda name: Opening(f"/lab{name}", number))
        with pytest.raises(ConnectError, match=rf"/lab/a cannot listen on 127\.0\.0\.1:{number}: .*environment"):
            network.open_address("/a")
        assert names.query("/lab/a") is None
        squatter.close()
        with Port("/a", network=network) as port:
            assert port.contact == Contact("/lab/a", "127.0.0.1", number, "tcp")

    @pytest.mark.parametrize("name", ["a", "a/b", "tcp://a"])
    def test_names_begin_with_a_slash(self, name: str):
        """The error about an invalid name shows a valid one, also if a prefix is invalid."""
        names = LocalNames()
        with pytest.raises(AddressError, match="begins with '/', such as"):
            Network(names).open_address(name)
        with pytest.raises(AddressError, match="'lab/a' is not a port name"):
            Network(names, opening=lambda name: Opening(f"lab{name}")).open_address("/a")
        assert names.list() == []

    def test_without_a_name(self):
        """A port without a name gets one from the names."""
        listening, contact = Network(LocalNames()).open_address("")
        listening.close()
        assert contact.name == "/tmp/port/1"
