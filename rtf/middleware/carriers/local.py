"""``local``: an object is passed within one process, in the writer's thread, without a copy.

Messages do not use a socket: the receiver gets the writer's own object, which neither side may change.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING
from weakref import WeakValueDictionary

from rtf.middleware.carriers.base import Carrier, InputLink, OutputLink
from rtf.middleware.carriers.stream import StreamClosedError
from rtf.middleware.errors import ConnectError
from rtf.middleware.wire import framing, modifiers
from rtf.middleware.wire.protocol import read_caller

if TYPE_CHECKING:
    from rtf.bottle import Dialect
    from rtf.middleware.carriers.base import CarrierPort
    from rtf.middleware.carriers.stream import Stream
    from rtf.middleware.types.codecs import Codec
    from rtf.middleware.wire.contact import Contact
    from rtf.middleware.wire.outgoing_message import OutgoingMessage
    from rtf.middleware.wire.protocol import Message

#: The ports of this process, by host and port number.
_ports: WeakValueDictionary[tuple[str, int], CarrierPort] = WeakValueDictionary()


def enrol(port: CarrierPort) -> None:
    """Register a port for this carrier."""
    _ports[port.contact.host, port.contact.port] = port


def ports_here() -> list[CarrierPort]:
    """Return the open ports of this process, of any network. May be called from any thread."""
    ports = [reference() for reference in _ports.valuerefs()]  # unlike values() safe if another thread opens a port
    return [port for port in ports if port is not None and not port.closed]


class LocalInput(InputLink):
    """The receiving end. It only notices the end of the connection; messages bypass it."""

    def receive(self) -> Message:
        """Wait for the end of the connection: messages bypass this link."""
        self._stream.discard()


class LocalOutput(OutputLink):
    """The sending end: it calls the receiving port directly."""

    def __init__(self, carrier: Carrier, stream: Stream, sender: str, target: CarrierPort) -> None:
        super().__init__(carrier, stream)
        self._sender = sender
        self._target = target
        self._reply: tuple[object, Codec[object]] | None = None
        self._closed = threading.Event()

    def send(self, message: OutgoingMessage) -> None:
        """Deliver the message. Return when the other port has processed it."""
        if self._closed.is_set() or self._target.closed:
            raise StreamClosedError(f"{self._target.name} is closed")
        self._reply = self._target.hand_over(self._sender, message)

    def receive_reply(self, codec: Codec[object], dialect: Dialect) -> object | None:
        """Return the reply. With a different codec it is encoded and decoded once, as over any connection."""
        if self._reply is None:
            return None
        value, written = self._reply
        if written is codec:
            return value
        return codec.decode(b"".join(written.encode(value, dialect)), dialect)

    def close(self, *, politely: bool = True) -> None:
        self._closed.set()
        super().close(politely=politely)


class Local(Carrier):
    """The handshake goes over TCP, so that both ports list the connection and notice its end."""

    name = "local"
    header = b"LOCALITY"
    has_dialects = False

    def accept(self, stream: Stream, port: CarrierPort) -> InputLink:  # noqa: ARG002
        """Read the caller's name."""
        return LocalInput(self, stream, stream.run(read_caller(stream)))

    def connect(self, stream: Stream, port: CarrierPort, target: Contact) -> OutputLink:
        """Find the target port in this process."""
        if modifiers.split(target.carrier)[1]:
            raise ConnectError("local takes no modifiers, as it passes objects without a message: use tcp")
        other = _ports.get((target.host, target.port))
        if other is None:
            raise ConnectError(f"{target.name} is not a port of this process: connect it by tcp or unix_stream")
        stream.send(self.header + framing.sender(port.name))
        return LocalOutput(self, stream, port.name, other)


LOCAL = Local()
