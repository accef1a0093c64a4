"""``tcp`` and ``fast_tcp``: binary messages over one TCP connection, with and without acknowledgement."""

from __future__ import annotations

import contextlib
import socket
import struct
from typing import TYPE_CHECKING

from rtf.middleware.carriers.base import (
    Carrier,
    InputLink,
    Message,
    OutputLink,
    PollableInputLink,
    StreamInput,
    StreamOutput,
    introduction,
    read_sender,
)
from rtf.middleware.carriers.stream import CHUNK, JOINED
from rtf.middleware.errors import ProtocolError, WaitTimeoutError
from rtf.middleware.wire import framing

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.carriers.base import CarrierPort
    from rtf.middleware.carriers.stream import Stream
    from rtf.middleware.types.codecs import Buffer
    from rtf.middleware.wire.contact import Contact
    from rtf.middleware.wire.outgoing_message import OutgoingMessage

# Module-level names: they are looked up faster.
_ACK, _ACK_SIZE = framing.ACK, len(framing.ACK)
_INDEX_SIZE, _COMMAND_SIZE, _MAX_MESSAGE = framing.INDEX_SIZE, framing.COMMAND_SIZE, framing.MAX_MESSAGE
_front, _read_command, _join = framing.front, framing.read_command, b"".join
#: The start of an acknowledgement, which no bottle begins with: a peer that sends it has no reply.
_NO_REPLY = framing.ACK[:4]
#: Index and command of the usual message of two blocks. The bytes in between are ignored.
_USUAL = struct.Struct("<10s8xii4x8s")
_USUAL_SIZE = _USUAL.size
_USUAL_HEAD = framing.front("D", "", 0)[:10]
_KEYS = {framing.command(letter): letter for letter in "dDaq"}
_read_usual = _USUAL.unpack_from


class TcpInput(StreamInput, PollableInputLink):
    """The receiving end of tcp and fast_tcp."""

    reuses = CHUNK
    acknowledgement = _ACK

    def welcome(self, stream: Stream, port: CarrierPort) -> None:
        stream.send(framing.yarp_number(port.contact.port))

    def receive(self) -> Message:
        """Wait for the next message.

        The usual message is read with one system call and one call of the struct module. No helper functions: each call
        costs a hundredth of the round trip.
        """
        stream = self._stream
        while stream.end - stream.start < _INDEX_SIZE:
            stream.more(_INDEX_SIZE)
        start, end = stream.start, stream.end
        if end - start < _USUAL_SIZE:
            return self._receive_any()
        head, first, size, command = _read_usual(stream.memory, start)
        if head != _USUAL_HEAD:
            return self._receive_any()
        key = _KEYS.get(command)
        if first != _COMMAND_SIZE or key is None:
            return self._receive_any()
        if not 0 <= size <= _MAX_MESSAGE:
            raise ProtocolError(f"a message of {size} bytes; at most {_MAX_MESSAGE} are accepted")
        start += _USUAL_SIZE
        if size > CHUNK or start + size > end:
            stream.start = start
            return key, "", stream.take(size)
        stream.start = start + size
        return key, "", stream.view[start : start + size]

    def _receive_any(self) -> Message:
        stream = self._stream
        blocks, rest = framing.index_rest(stream.peek(framing.INDEX_SIZE))
        stream.skip(framing.INDEX_SIZE)
        size = framing.message_size(stream.take(rest), 0, blocks)
        data = stream.take(size)
        key, text, begin = _read_command(data)
        return key, text, data[begin:]

    def answer(self, *reply: Buffer) -> None:
        """Finish the last message. The usual cases are the acknowledgement alone, or a short reply before it."""
        if not self._acknowledged:
            super().answer(*reply)
        elif not reply:
            self._stream.send_bytes(_ACK)
        elif len(reply) == 1 and len(reply[0]) <= JOINED:
            self._stream.send_bytes(_join((reply[0], _ACK)))
        else:
            self._stream.send(*reply, _ACK)

    def reversed(self, stream: Stream) -> OutputLink:
        return TcpOutput(self.carrier, stream)

    def fill(self) -> None:
        with contextlib.suppress(WaitTimeoutError):  # nothing has arrived
            self._stream.more(1, socket.MSG_DONTWAIT)

    def missing(self) -> int:
        stream = self._stream
        start, have = stream.start, stream.buffered
        if have < _INDEX_SIZE:
            return _INDEX_SIZE - have
        blocks, rest = framing.index_rest(stream.view, start)
        front = _INDEX_SIZE + rest
        if have < front:
            return front - have
        return max(0, front + framing.message_size(stream.view, start + _INDEX_SIZE, blocks) - have)

    def acknowledge(self, count: int) -> None:
        if self._acknowledged and count:
            self._stream.send_bytes(_ACK * count, socket.MSG_DONTWAIT)


class TcpOutput(StreamOutput):
    """The sending end of tcp and fast_tcp. ``_due`` is the number of outstanding acknowledgements."""

    def __init__(self, carrier: Carrier, stream: Stream) -> None:
        super().__init__(carrier, stream, _NO_REPLY)

    def send(self, message: OutgoingMessage) -> None:
        blocks = message.blocks
        self._due += self._acknowledged
        if len(blocks) == 1 and len(blocks[0]) <= JOINED:
            block = blocks[0]
            self._stream.send_bytes(_front(message.key, message.envelope, len(block)) + block)
        else:
            self._stream.send(_front(message.key, message.envelope, message.size), *blocks)

    def send_all(self, messages: Sequence[OutgoingMessage]) -> None:
        """Send several messages. Small ones are joined, so that the reader is woken once."""
        pieces: list[Buffer] = []
        for message in messages:
            pieces.append(_front(message.key, message.envelope, message.size))
            pieces += message.blocks
        if sum(map(len, pieces)) <= CHUNK:
            self._due += self._acknowledged * len(messages)
            self._stream.send_bytes(_join(pieces))
        else:
            for message in messages:
                self.send(message)

    def finish(self) -> None:
        stream = self._stream
        while self._due:
            while stream.end - stream.start < _ACK_SIZE:
                stream.more(_ACK_SIZE)
            if stream.memory.startswith(_ACK, stream.start):  # the usual case
                stream.start += _ACK_SIZE
            else:
                self._take_unusual()
            self._due -= 1

    def _take_unusual(self) -> None:
        """Read an acknowledgement with a payload, which has no meaning."""
        extra = framing.read_number(self._stream.take(_ACK_SIZE))
        if not 0 <= extra <= _MOST_EXTRA:
            raise ProtocolError(f"an acknowledgement with {extra} bytes")
        if extra:
            self._stream.take(extra)

    def _send_quit(self) -> None:
        command = framing.command_text("q")
        self._stream.send(framing.index(len(command)) + command)
        self._due += self._acknowledged
        self.finish()


_MOST_EXTRA = 10_000
_RELEVANT = 128 + 15


class Tcp(Carrier):
    """Messages are acknowledged after the receiver has processed them."""

    name = "tcp"
    header = framing.header(131)
    acknowledged = True

    def matches(self, header: bytes) -> bool:
        """Compare the lowest four bits of the carrier number, and the bit that requests acknowledgements."""
        number = framing.specifier(header)
        return number >= 0 and number & _RELEVANT == framing.specifier(self.header)

    def accept(self, stream: Stream, port: CarrierPort) -> InputLink:  # noqa: ARG002 - the reply comes later
        """Read the sender's name and answer with this port's number."""
        sender, modifiers = read_sender(stream)
        return TcpInput(self, stream, sender, modifiers)

    def connect(self, stream: Stream, port: CarrierPort, target: Contact) -> OutputLink:
        return self.call(stream, introduction(port, target))

    def call(self, stream: Stream, name: str) -> TcpOutput:
        """Send the name of the caller, a port or a label. The peer's answer has no meaning."""
        stream.send(self.header + framing.sender(name))
        framing.read_number(stream.take(8))
        return TcpOutput(self, stream)


class FastTcp(Tcp):
    """Messages are not acknowledged. A sender blocks only when the network buffers are full."""

    name = "fast_tcp"
    header = framing.header(3)
    acknowledged = False
