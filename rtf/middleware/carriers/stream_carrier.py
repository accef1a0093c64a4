"""Carriers whose greeting and messages are on one stream, such as ``tcp`` and ``text``, and the ends of a connection.

What travels is defined by a protocol of :mod:`rtf.middleware.wire`; here it meets the socket.
"""

from __future__ import annotations

import contextlib
import socket
from typing import TYPE_CHECKING

from rtf.middleware.carriers.base import Carrier, InputLink, OutputLink
from rtf.middleware.errors import ConnectError, MiddlewareError, WaitTimeoutError
from rtf.middleware.wire import binary, framing, lines, modifiers
from rtf.middleware.wire.inbox import CHUNK
from rtf.middleware.wire.outgoing_message import JOINED
from rtf.middleware.wire.protocol import Caller

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Dialect
    from rtf.middleware.carriers.base import CarrierNetwork, CarrierPort
    from rtf.middleware.carriers.stream import Stream
    from rtf.middleware.types.codecs import Buffer, Codec
    from rtf.middleware.wire.contact import Contact
    from rtf.middleware.wire.outgoing_message import OutgoingMessage
    from rtf.middleware.wire.protocol import Message, Receiver, Sender, StreamProtocol

#: Seconds that a peer has to answer the end of a connection.
_PATIENCE = 1.0


class StreamInput(InputLink):
    """The receiving end of a connection over a stream.

    ``pollable``: it can also be read without waiting, so that one thread can serve many.
    """

    def __init__(self, carrier: Carrier, stream: Stream, receiver: Receiver, caller: Caller) -> None:
        super().__init__(carrier, stream, caller)
        self.reuses = receiver.reuses
        self.pollable = receiver.framed
        self._receiver = receiver
        self._messages = receiver.messages()
        self._acknowledgement = receiver.acknowledgement

    def welcome(self, stream: Stream, port: CarrierPort) -> None:
        reply = self._receiver.welcome(Caller(self.sender, self.modifiers), port.contact.port)
        if reply:
            stream.send(reply)

    def receive(self) -> Message:
        """Wait for the next message. No helper functions: each call costs a hundredth of the round trip."""
        stream = self._stream
        if stream.start == stream.end:  # so whatever the protocol is at, it waits for more
            stream.more(1)
        messages = self._messages
        while type(step := next(messages)) is not tuple:  # twice as fast as isinstance
            stream.more(step)  # type: ignore[arg-type]  # a number
        return step

    def poll(self) -> Message | int:
        """Return the next message if it has arrived, else how many bytes of it are known to be missing."""
        step = next(self._messages)
        return step - self._stream.unread if isinstance(step, int) else step

    def fill(self) -> None:
        """Read what has arrived, if anything. Raises StreamClosedError at the end of the connection."""
        with contextlib.suppress(WaitTimeoutError):  # nothing has arrived
            self._stream.more(self._stream.unread + 1, socket.MSG_DONTWAIT)

    def acknowledge(self, count: int) -> None:
        """Acknowledge ``count`` messages that have no reply. Raises WaitTimeoutError instead of waiting."""
        if self._acknowledgement and count:
            self._stream.send_bytes(self._acknowledgement * count, socket.MSG_DONTWAIT)

    def answer(self, *reply: Buffer) -> None:
        if len(reply) == 1 and len(reply[0]) <= JOINED:  # the usual case
            self._stream.send_bytes(b"".join((reply[0], self._acknowledgement)))
        elif reply:
            self._stream.send(*reply, self._acknowledgement)
        elif self._acknowledgement:
            self._stream.send_bytes(self._acknowledgement)

    def reversed(self, stream: Stream) -> OutputLink:
        if not isinstance(self.carrier, StreamCarrier):
            return super().reversed(stream)
        return self.carrier.output(stream)


class StreamOutput(OutputLink):
    """The sending end of a connection over a stream."""

    def __init__(self, carrier: Carrier, stream: Stream, sender: Sender) -> None:
        super().__init__(carrier, stream)
        self._sender = sender

    def send(self, message: OutgoingMessage) -> None:
        blocks = self._sender.message(message)
        if len(blocks) == 1:
            self._stream.send_bytes(blocks[0])
        else:
            self._stream.send(*blocks)

    def send_all(self, messages: Sequence[OutgoingMessage]) -> None:
        """Send several messages without waiting. Small ones are joined, so that the reader is woken once."""
        pieces = [piece for message in messages for piece in self._sender.message(message)]
        if sum(map(len, pieces)) <= CHUNK:
            pieces = [b"".join(pieces)]
        self._stream.send(*pieces)

    def receive_reply(self, codec: Codec[object], dialect: Dialect) -> object | None:
        sender = self._sender
        while size := sender.reply(codec, dialect):
            self._stream.more(size)
        return sender.answer

    def finish(self) -> None:
        while self._sender.due and (size := self._sender.acknowledgements()):
            self._stream.more(size)

    def close(self, *, politely: bool = True) -> None:
        if politely:
            with contextlib.suppress(MiddlewareError, OSError):  # the peer is gone already
                self._stream.limit_waiting(_PATIENCE)
                self._stream.send(self._sender.end())
                self.finish()
        super().close()


class StreamCarrier(Carrier):
    """A carrier that is one of the protocols over a stream."""

    def __init__(self, protocol: StreamProtocol) -> None:
        self.protocol = protocol
        self.name = protocol.name
        self.header = protocol.header
        self.acknowledged = protocol.acknowledged
        self.text = protocol.text
        self.has_dialects = not protocol.text

    def accept(self, stream: Stream, port: CarrierPort) -> InputLink:  # noqa: ARG002 - the reply comes later
        """Read the caller's name."""
        receiver = self.protocol.receiver(stream, acknowledged=self.acknowledged)
        return StreamInput(self, stream, receiver, stream.run(receiver.greeting()))

    def connect(self, stream: Stream, port: CarrierPort, target: Contact) -> OutputLink:
        return self.call(stream, introduction(port, target))

    def call(self, stream: Stream, name: str) -> StreamOutput:
        """Perform the handshake on behalf of a caller, a port or a label."""
        sender = self.protocol.sender(stream, acknowledged=self.acknowledged)
        stream.run(sender.greet(self.header, name))
        return StreamOutput(self, stream, sender)

    def output(self, stream: Stream) -> StreamOutput:
        """Return the sending end of a connection whose handshake is done."""
        return StreamOutput(self, stream, self.protocol.sender(stream, acknowledged=self.acknowledged))


class TcpCarrier(StreamCarrier):
    """``tcp`` or ``fast_tcp``, whose header is a number with some bits that matter."""

    _RELEVANT = 128 + 15

    def matches(self, header: bytes) -> bool:
        """Compare the lowest four bits of the carrier number, and the bit that requests acknowledgements."""
        number = framing.specifier(header)
        return number >= 0 and number & self._RELEVANT == framing.specifier(self.header)


TCP = TcpCarrier(binary.TCP)
FAST_TCP = TcpCarrier(binary.FAST_TCP)
TEXT = StreamCarrier(lines.TEXT)
TEXT_ACK = StreamCarrier(lines.TEXT_ACK)


def introduction(port: CarrierPort, target: Contact) -> str:
    """Return the name of a caller and the modifiers of its connection. Raises ConnectError if they are too long."""
    text = f"{port.name} {modifiers.split(target.carrier)[1]}".rstrip()
    if text != port.name and len(text.encode("utf-8", "surrogateescape")) >= framing.MAX_NAME:
        raise ConnectError(f"the modifiers of {target.carrier[:80]}… are too long")
    return text


def announce_end(network: CarrierNetwork, target: Contact, sender: str) -> None:
    """Tell a port, over a separate connection, that it receives nothing more from ``sender``. Raises ConnectError.

    For carriers whose receivers cannot notice the end.
    """
    with contextlib.closing(network.reach(target)) as stream:
        stream.send(lines.TEXT.header + lines.as_lines("admin", f"~{sender}", "q"))
        stream.discard()  # until it closes: a later connection must not be affected by this command
