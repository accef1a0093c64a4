"""``local``: within one process an object is handed over as it is, in the writer's thread, without being copied.

Its two ends meet here and not on a socket: what arrives is the writer's own object, which neither side may change.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING
from weakref import WeakValueDictionary

from rtf.middleware.carriers.base import Buffer, Carrier, InputLink, Message, OutputLink
from rtf.middleware.errors import ConnectError
from rtf.middleware.stream import StreamClosedError

if TYPE_CHECKING:
    from rtf.bottle import Dialect
    from rtf.middleware.codecs import Codec
    from rtf.middleware.names import Contact
    from rtf.middleware.outgoing import Outgoing
    from rtf.middleware.port import Port
    from rtf.middleware.stream import Stream

#: The ports of this process by their number, which no two of them share.
_ports: WeakValueDictionary[tuple[str, int], Port] = WeakValueDictionary()


def enrol(port: Port) -> None:
    """Let a port be reached by this carrier."""
    _ports[port.contact.host, port.contact.port] = port


def ports_here() -> list[Port]:
    """The ports of this process that are open, whatever network they are of. From any thread."""
    ports = [reference() for reference in _ports.valuerefs()]  # unlike values() no matter who opens one meanwhile
    return [port for port in ports if port is not None and not port.closed]


class LocalInput(InputLink):
    """The receiving end: it only knows when it is over, messages pass by it."""

    def __init__(self, carrier: Carrier, stream: Stream, sender: str) -> None:
        self.carrier = carrier
        self.sender = sender
        self.endpoint = stream.socket
        self._stream = stream

    def receive(self) -> Message:
        """Wait for the end of the connection. See the base."""
        while True:
            self._stream.take(1)

    def answer(self, *reply: Buffer) -> None:
        """There is nothing to answer here."""

    def close(self) -> None:
        self._stream.close()


class LocalOutput(OutputLink):
    """The sending end: it calls the other port."""

    def __init__(self, carrier: Carrier, stream: Stream, sender: str, target: Port) -> None:
        self.carrier = carrier
        self.endpoint = stream.socket
        self._stream = stream
        self._sender = sender
        self._target = target
        self._reply: tuple[object, Codec[object]] | None = None
        self._closed = threading.Event()

    def send(self, message: Outgoing) -> None:
        """See the base; returns when the other port has dealt with it."""
        if self._closed.is_set() or self._target.closed:
            raise StreamClosedError(f"{self._target.name} is closed")
        self._reply = self._target.hand_over(self._sender, message)

    def receive_reply(self, codec: Codec[object], dialect: Dialect) -> object | None:
        """See the base. A reply of another type is written and read once, as on any other connection."""
        if self._reply is None:
            return None
        value, written = self._reply
        if written is codec:
            return value
        return codec.decode(b"".join(written.encode(value, dialect)), dialect)

    def finish(self) -> None:
        """It has been dealt with already."""

    def limit_waiting(self, seconds: float | None) -> None:
        """Nobody is waited for here: the other port's owner works in this thread."""

    def close(self, *, politely: bool = True) -> None:  # noqa: ARG002 - the end of the stream says it
        self._closed.set()
        self._stream.close()


class Local(Carrier):
    """The handshake goes over TCP, so that both ports list the connection and notice its end."""

    name = "local"
    header = b"LOCALITY"

    def accept(self, stream: Stream, port: Port) -> InputLink:  # noqa: ARG002
        """Take the caller's name."""
        from rtf.middleware.carriers.tcp import read_sender

        return LocalInput(self, stream, read_sender(stream)[0])

    def connect(self, stream: Stream, port: Port, target: Contact) -> OutputLink:
        """Find the port in this process."""
        from rtf.middleware import wire

        other = _ports.get((target.host, target.port))
        if other is None:
            raise ConnectError(f"{target.name} is not a port of this process: connect it by tcp or unix_stream")
        stream.send(self.header + wire.sender(port.name))
        return LocalOutput(self, stream, port.name, other)
