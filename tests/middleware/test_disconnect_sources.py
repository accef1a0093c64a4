"""A port that closes asks its sources to disconnect, and closes in bounded time."""

from __future__ import annotations

import socket
import threading
from typing import TYPE_CHECKING

import pytest

from free_ports import free_port
from rtf import clock
from rtf.bottle import Bottle, Dialect, Vocab
from rtf.middleware.ports import disconnect_sources, remote
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.port import Port
from rtf.middleware.wire import framing
from waiting import eventually

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage

#: Seconds that all sources together may take, and the addition for a busy machine.
_PATIENCE = 1.0
_BUSY = 1.0


def caller(port: Port, name: str) -> socket.socket:
    """Connect to a port under this name."""
    connection = socket.create_connection((port.contact.host, port.contact.port), 10)
    connection.sendall(framing.header(3) + framing.sender(name))
    eventually(lambda: any(one.sender == name for one in port.inputs), "the caller has not come")
    return connection


class TestSources:
    """The sources of a port."""

    @pytest.mark.parametrize("carrier", ["tcp", "fast_tcp", "udp", "mcast", "text_ack", "unix_stream"])
    def test_disconnect(self, network: Network, monkeypatch: pytest.MonkeyPatch, carrier: str):
        """After closing no writer lists the port, and none has lost a connection by an error.

        The duration is not tested here, so that a busy machine has all the time it needs.
        """
        monkeypatch.setattr(disconnect_sources, "_PATIENCE", 30.0)
        writers = [Port(f"/writer/{number}", network=network) for number in range(10)]
        with BufferedPort("/reader", network=network) as reader:
            for writer in writers:
                writer.add_output("/reader", carrier)
            # A writer also asks for the dialect, by a connection of its own that may last a little longer.
            eventually(lambda: [one.carrier for one in reader.inputs].count(carrier) == 10, "the writers have not come")
        listed = [remote.administer(network, writer.contact, Bottle([Vocab("list")])) for writer in writers]
        assert listed == [Bottle()] * 10
        for writer in writers:
            writer.close()

    def test_in_their_own_words(self, network: Network):
        """A source is asked by administration, which ports of any make understand."""
        asked: list[bytes] = []
        with socket.create_server(("127.0.0.1", 0)) as listening:
            thread = threading.Thread(target=_answer, args=(listening, asked))
            thread.start()
            network.names.register("/source", carrier="tcp", host="127.0.0.1", port=listening.getsockname()[1])
            with Port("/reader", network=network) as reader, caller(reader, "/source"):
                reader.close()
            thread.join(10)
        assert asked == [b"CONNACK admin\r\n", b"a\r\n", b'[del] "/reader"\r\n']

    def test_local_ones_are_left_alone(self, network: Network, noticed: list[str]):
        """Sources in the same process and the port itself are disconnected without a request."""
        with Port("/writer", network=network) as writer, BufferedPort("/reader", network=network) as reader:
            writer.add_output("/reader", "local")
            reader.add_output("/reader")
            eventually(lambda: len(reader.inputs) == 2, "the writers have not come")
            before = len(noticed)
            reader.close()
            assert "Removing output from /writer to /reader" not in noticed[before:]
            assert "Removing output from /reader to /reader" in noticed[before:]

    def test_none_that_have_no_port(self, network: Network):
        """Callers without a registered port are not asked."""
        with Port("/reader", network=network) as reader:
            connections = [caller(reader, name) for name in ("admin", "/unknown")]
            began = clock.monotonic()
            reader.close()
            assert clock.monotonic() - began < _PATIENCE
        for connection in connections:
            connection.close()


class TestBounded:
    """Sources that do not answer."""

    def test_stalled_ones(self, network: Network):
        """Sources that do not answer delay closing by about a second, whatever their number."""
        with Port("/reader", network=network) as reader:
            held = [socket.create_server(("127.0.0.1", 0)) for _ in range(30)]
            for number, listening in enumerate(held):
                name = f"/stalled/{number}"
                network.names.register(name, carrier="tcp", host="127.0.0.1", port=listening.getsockname()[1])
                held.append(caller(reader, name))  # type: ignore[arg-type]
                if number == 29:
                    break
            began = clock.monotonic()
            reader.close()
            assert clock.monotonic() - began < _PATIENCE + _BUSY
        for one in held:
            one.close()

    def test_dead_ones(self, network: Network):
        """Sources whose port is gone do not delay closing."""
        network.names.register("/dead", carrier="tcp", host="127.0.0.1", port=free_port())
        with Port("/reader", network=network) as reader, caller(reader, "/dead"):
            began = clock.monotonic()
            reader.close()
            assert clock.monotonic() - began < _PATIENCE

    def test_one_that_waits_for_the_port(self, network: Network):
        """A callback that closes its port does not ask the writer that waits for this callback."""
        took: list[float] = []

        def close(delivery: IncomingMessage) -> None:
            began = clock.monotonic()
            reader.close()
            took.append(clock.monotonic() - began)

        reader = Port("/reader", close, network=network)
        with Port("/writer", network=network) as writer:
            writer.add_output("/reader")
            writer.write(Bottle([1]))
            eventually(lambda: took, "it was not closed")
            assert took[0] < _PATIENCE
            assert not writer.outputs

    def test_two_that_send_to_each_other(self, network: Network):
        """Two ports that send to each other can be closed at the same time."""
        ports = [BufferedPort(f"/port/{number}", network=network) for number in range(2)]
        for one, other in (ports, reversed(ports)):
            one.add_output(other.name)
        eventually(lambda: all(port.inputs for port in ports), "they are not connected")
        threads = [threading.Thread(target=port.close) for port in ports]
        began = clock.monotonic()
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert clock.monotonic() - began < 2 * _PATIENCE + _BUSY


def _answer(listening: socket.socket, asked: list[bytes]) -> None:
    connection, _ = listening.accept()
    with connection, connection.makefile("rwb", buffering=0) as lines:
        for reply in (b"Welcome admin\r\n", b"", b'0 "Removed"\r\n<ACK>\r\n'):
            asked.append(lines.readline())
            lines.write(reply)


class TestNotices:
    """The reports of connections, with YARP's texts."""

    @pytest.mark.parametrize("carrier", ["tcp", "fast_tcp", "udp", "local", "text_ack"])
    def test_made_and_ended(self, network: Network, noticed: list[str], said: list[str], carrier: str):
        """Each end reports a connection and its end once, and no problem."""
        with Port("/writer", network=network) as writer, BufferedPort("/reader", network=network) as reader:
            writer.add_output("/reader", carrier)
            eventually(lambda: len(noticed) == 2, "it was not reported")
            assert sorted(noticed) == [
                f"Receiving input from /writer to /reader using {carrier}",
                f"Sending output from /writer to /reader using {carrier}",
            ]
            noticed.clear()
            writer.remove_output("/reader")
            eventually(lambda: not reader.inputs, "the input is left")
            eventually(lambda: len(noticed) == 2, "its end was not reported")
            assert sorted(noticed) == [
                "Removing input from /writer to /reader",
                "Removing output from /writer to /reader",
            ]
        assert said == []

    def test_tools_are_not_worth_it(self, network: Network, noticed: list[str]):
        """Callers without a port, such as tools, are not reported."""
        with Port("/port", network=network) as port:
            assert remote.exists(network, port.contact)
            remote.describe(network, port.contact)
            with port.network.reach(port.contact).socket:
                pass
            eventually(lambda: not port.inputs, "an input is left")
        assert noticed == []

    def test_connection_that_breaks(self, network: Network, noticed: list[str], said: list[str]):
        """A broken connection is reported as ended, and as a problem."""
        network.dialect = Dialect.YARP3  # the peer is not asked for it
        with socket.create_server(("127.0.0.1", 0)) as listening, Port("/writer", network=network) as writer:
            network.names.register("/gone", carrier="tcp", host="127.0.0.1", port=listening.getsockname()[1])
            thread = threading.Thread(target=_welcome, args=(listening,))
            thread.start()
            writer.add_output("/gone")
            thread.join(10)
            assert writer.write(Bottle([1])) == 0
        assert noticed == [
            "Sending output from /writer to /gone using tcp",
            "Removing output from /writer to /gone",
        ]
        assert len(said) == 1
        assert said[0].startswith("Removing output from /writer to /gone: ")


def _welcome(listening: socket.socket) -> None:
    connection, _ = listening.accept()
    with connection:
        connection.recv(100)
        connection.sendall(framing.yarp_number(1))


@pytest.fixture
def noticed(network: Network) -> list[str]:
    """The network's reports of connections."""
    heard: list[str] = []
    network.notice = heard.append
    return heard
