"""The dialect of each reader: a port asks for it before the first message, as YARP's ports answer."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
from typing import TYPE_CHECKING, Self

import pytest

from rtf.bottle import Bottle, Dialect
from rtf.bottle.binary import encode
from rtf.middleware.errors import AddressError
from rtf.middleware.naming.configuration import find_dialect
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.pipelined_port import PipelinedPort
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.types.vector import VECTOR
from rtf.middleware.wire import framing
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import TracebackType

    from rtf.middleware.ports.network import Network

#: How each version writes 1.5 in the reply to a binary admin message, as observed with YARP 3.12.3 and 4.0.0.
REPLIES = {
    Dialect.YARP3: bytes.fromhex("0a010000 01000000") + struct.pack("<d", 1.5),
    Dialect.YARP4: bytes.fromhex("14010000 01000000") + struct.pack("<d", 1.5),
}
NUMBERS = Bottle([1.0, 2.5, 3.5])


class ForeignPort:
    """A port that answers like one of YARP, and keeps the bytes of the messages that it receives.

    With ``dialect`` None it knows no properties, so that its dialect stays unknown.
    """

    def __init__(self, network: Network, name: str, dialect: Dialect | None) -> None:
        self.messages: list[bytes] = []
        self.connections = 0
        self._dialect = dialect
        self._listening = socket.create_server(("127.0.0.1", 0))
        self._threads = [threading.Thread(target=self._accept)]
        self._threads[0].start()
        network.names.register(name, carrier="tcp", host="127.0.0.1", port=self._listening.getsockname()[1])

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                peer, _ = self._listening.accept()
                self.connections += 1
                self._threads.append(threading.Thread(target=self._serve, args=(peer,)))
                self._threads[-1].start()

    def _serve(self, peer: socket.socket) -> None:
        with peer, peer.makefile("rb") as stream, contextlib.suppress(OSError):
            header = stream.read(8)
            if header == b"CONNACK ":
                peer.sendall(b"Welcome " + stream.readline().strip() + b"\r\n")
                while stream.readline().strip() == b"a":
                    stream.readline()
                    peer.sendall((b"[ok]" if self._dialect else b'[fail] "unknown"') + b"\r\n<ACK>\r\n")
            elif header == framing.header(131):
                (size,) = struct.unpack("<i", stream.read(4))
                stream.read(size)
                peer.sendall(framing.yarp_number(1))
                self._take_messages(peer, stream)

    def _take_messages(self, peer: socket.socket, stream: object) -> None:
        while head := stream.read(18):  # type: ignore[attr-defined]
            blocks, rest = framing.index_rest(head)
            lengths = stream.read(rest)  # type: ignore[attr-defined]
            data = stream.read(framing.message_size(lengths, 0, blocks))  # type: ignore[attr-defined]
            key, _, begin = framing.read_command(data)
            if key == "q":
                return
            reply = b""
            if key == "a":
                reply = REPLIES[self._dialect] if self._dialect else encode(Bottle(["?"]), Dialect.YARP3)
            else:
                self.messages.append(bytes(data[begin:]))
            if key == "d":
                reply = encode(Bottle([0.5]), self._dialect or Dialect.YARP3)
            peer.sendall(reply + framing.ACK)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()
        for thread in self._threads:
            thread.join(10)


@pytest.fixture
def three(network: Network) -> Iterator[ForeignPort]:
    """A port of YARP 3."""
    with ForeignPort(network, "/three", Dialect.YARP3) as port:
        yield port


@pytest.fixture
def four(network: Network) -> Iterator[ForeignPort]:
    """A port of YARP 4."""
    with ForeignPort(network, "/four", Dialect.YARP4) as port:
        yield port


class TestWriters:
    """Ports with readers of both versions."""

    @pytest.mark.parametrize("kind", [Port, BufferedPort, PipelinedPort])
    def test_each_reader_gets_its_own_numbers(
        self, network: Network, three: ForeignPort, four: ForeignPort, kind: type[Port]
    ) -> None:
        """A message is encoded in the dialect of each reader."""
        with kind("/writer", network=network) as writer:
            writer.add_output("/three")
            writer.add_output("/four")
            writer.write(NUMBERS)
            eventually(lambda: three.messages and four.messages, "a message is missing")
        assert three.messages == [encode(NUMBERS, Dialect.YARP3)]
        assert four.messages == [encode(NUMBERS, Dialect.YARP4)]

    def test_frozen_message_keeps_its_contents(self, network: Network, three: ForeignPort, four: ForeignPort) -> None:
        """A buffered port's object may change after ``write``, whatever the dialects of its readers."""
        with BufferedPort("/writer", VECTOR, network=network) as writer:
            writer.add_output("/three")
            writer.add_output("/four")
            values = [1.5, 2.5]
            writer.write(values)
            values[:] = [0.0, 0.0]
            eventually(lambda: three.messages and four.messages, "a message is missing")
        assert three.messages == [b"".join(VECTOR.encode([1.5, 2.5], Dialect.YARP3))]
        assert four.messages == [b"".join(VECTOR.encode([1.5, 2.5], Dialect.YARP4))]

    def test_clients_ask_first(self, network: Network, four: ForeignPort) -> None:
        """The first request of a client is in the server's dialect."""
        with RpcClient("/client", "/four", network=network) as client:
            assert client.call(NUMBERS, timeout=10) == Bottle([0.5])
        assert four.messages == [encode(NUMBERS, Dialect.YARP4)]


class TestReadersOfUnknownDialect:
    """Readers whose dialect cannot be found out."""

    def test_numbers_are_refused(self, network: Network, said: list[str]) -> None:
        """A message that differs in the two dialects ends the connection, with a hint; others are sent."""
        with ForeignPort(network, "/silent", None) as reader, Port("/writer", network=network) as writer:
            writer.add_output("/silent")
            assert any("/silent does not tell whether it speaks YARP 3 or 4" in line for line in said)
            assert writer.write(Bottle(["get", 7])) == 1
            assert writer.write(NUMBERS) == 0
            assert any("set RTF_DIALECT to 3 or 4" in line for line in said), said
        assert reader.messages == [encode(Bottle(["get", 7]), Dialect.YARP3)]

    @pytest.mark.parametrize("dialect", [*Dialect])
    def test_setting(self, network: Network, dialect: Dialect) -> None:
        """A dialect that is set is used without asking."""
        network.dialect = dialect
        with ForeignPort(network, "/silent", None) as reader, Port("/writer", network=network) as writer:
            writer.add_output("/silent")
            assert writer.write(NUMBERS) == 1
        assert reader.messages == [encode(NUMBERS, dialect)]
        assert reader.connections == 1


class TestCost:
    """The cost of asking for the dialect."""

    def test_own_ports_are_asked_once(self, network: Network) -> None:
        """A port of this library announces its dialect in its first reply, and stores no property."""
        with Port("/reader", lambda message: message.read(), network=network) as reader:
            with Port("/writer", network=network) as writer:
                before = reader.properties.to_bottle()
                writer.add_output("/reader")
                assert writer.outputs[0].dialect is network.dialect
            assert reader.properties.to_bottle() == before

    def test_text_has_no_dialects(self, network: Network) -> None:
        """A reader by text is not asked for its dialect."""
        network.names.register("/nothing", carrier="tcp", host="127.0.0.1", port=1)
        with Port("/reader", lambda message: message.read(), network=network), Port("/w", network=network) as writer:
            writer.add_output("/reader", "text_ack")
            assert writer.write(NUMBERS) == 1


class TestSettingOfTheEnvironment:
    """The variable RTF_DIALECT."""

    @pytest.mark.parametrize(("text", "dialect"), [("3", Dialect.YARP3), ("4", Dialect.YARP4), ("", None)])
    def test_values(self, text: str, dialect: Dialect | None) -> None:
        """3 and 4 set the dialect, and an empty value lets ports ask."""
        assert find_dialect({"RTF_DIALECT": text}) is dialect

    @pytest.mark.parametrize("text", ["5", "yarp4", "3.12", " "])
    def test_others_are_errors(self, text: str) -> None:
        """Another value is an error that names the variable."""
        with pytest.raises(AddressError, match="RTF_DIALECT"):
            find_dialect({"RTF_DIALECT": text})
