"""``tcp`` and ``fast_tcp``: binary messages with an index, with and without acknowledgement."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from rtf.middleware.errors import ProtocolError
from rtf.middleware.wire import framing
from rtf.middleware.wire.inbox import CHUNK
from rtf.middleware.wire.outgoing_message import JOINED
from rtf.middleware.wire.protocol import Receiver, Sender, StreamProtocol

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.types.codecs import Buffer
    from rtf.middleware.wire.inbox import Reading, Steps
    from rtf.middleware.wire.outgoing_message import OutgoingMessage
    from rtf.middleware.wire.protocol import Caller, Message, Messages

# Module-level names: they are looked up faster.
_ACK, _ACK_SIZE = framing.ACK, len(framing.ACK)
_INDEX_SIZE, _COMMAND_SIZE, _MAX_MESSAGE = framing.INDEX_SIZE, framing.COMMAND_SIZE, framing.MAX_MESSAGE
_front = framing.front
#: Index and command of the usual message of two blocks. The bytes in between are ignored.
_USUAL = struct.Struct("<10s8xii4x8s")
_USUAL_SIZE = _USUAL.size
_USUAL_HEAD = framing.front("D", "", 0)[:10]
_KEYS = {framing.command(letter): letter for letter in "dDaq"}
_read_usual = _USUAL.unpack_from
#: The most bytes with an acknowledgement.
_MOST_EXTRA = 10_000


class BinaryReceiver(Receiver):
    """The receiving end of tcp and fast_tcp."""

    reuses = CHUNK
    framed = True
    acknowledgement = _ACK

    def welcome(self, caller: Caller, number: int) -> bytes:  # noqa: ARG002 - it has no name
        return framing.yarp_number(number)

    def messages(self) -> Messages:
        """Receive messages. The usual one is read with one call of the struct module."""
        inbox = self.inbox
        while True:
            while inbox.end - inbox.start < _INDEX_SIZE:
                yield _INDEX_SIZE
            start, end = inbox.start, inbox.end
            if end - start >= _USUAL_SIZE:
                head, first, size, command = _read_usual(inbox.memory, start)
                key = _KEYS.get(command)
                if head == _USUAL_HEAD and first == _COMMAND_SIZE and key is not None:
                    if not 0 <= size <= _MAX_MESSAGE:
                        raise ProtocolError(f"a message of {size} bytes; at most {_MAX_MESSAGE} are accepted")
                    start += _USUAL_SIZE
                    if size <= CHUNK and start + size <= end:
                        inbox.start = start + size
                        yield key, "", inbox.view[start : start + size]
                        continue
                    inbox.start = start
                    while inbox.unread < size:
                        yield size
                    yield key, "", inbox.pop(size)
                    continue
            yield (yield from self._any_message())

    def _any_message(self) -> Reading[Message]:
        """Read a message with any number of blocks, or with an envelope."""
        inbox = self.inbox
        blocks, rest = framing.index_rest(inbox.memory, inbox.start)
        front = _INDEX_SIZE + rest
        while inbox.unread < front:
            yield front
        size = framing.message_size(inbox.memory, inbox.start + _INDEX_SIZE, blocks)
        inbox.pop(front)
        while inbox.unread < size:
            yield size
        data = inbox.pop(size)
        key, text, begin = framing.read_command(data)
        return key, text, data[begin:]


class BinarySender(Sender):
    """The sending end of tcp and fast_tcp."""

    #: The start of an acknowledgement, which no bottle begins with.
    no_reply = _ACK[:4]

    def greet(self, header: bytes, name: str) -> Steps[None]:
        """Send the name of the caller. The peer's answer has no meaning."""
        yield header + framing.sender(name)
        framing.read_number((yield from self.inbox.take(_ACK_SIZE)))

    def message(self, message: OutgoingMessage) -> Sequence[Buffer]:
        self.due += self.acknowledged
        blocks = message.blocks
        if len(blocks) == 1 and len(block := blocks[0]) <= JOINED:
            return (_front(message.key, message.envelope, len(block)) + block,)
        return (_front(message.key, message.envelope, message.size), *blocks)

    def acknowledgements(self) -> int:
        inbox = self.inbox
        while self.due:
            unread = inbox.end - inbox.start
            if unread < _ACK_SIZE:
                return _ACK_SIZE
            size = _ACK_SIZE
            if not inbox.memory.startswith(_ACK, inbox.start):  # it has a payload, which has no meaning
                extra = framing.read_number(inbox.memory, inbox.start)
                if not 0 <= extra <= _MOST_EXTRA:
                    raise ProtocolError(f"an acknowledgement with {extra} bytes")
                size += extra
                if unread < size:
                    return size
            inbox.start += size
            self.due -= 1
        return 0

    def end(self) -> bytes:
        self.due += self.acknowledged
        command = framing.command_text("q")
        return framing.index(len(command)) + command


TCP = StreamProtocol("tcp", framing.header(131), BinaryReceiver, BinarySender, acknowledged=True)
FAST_TCP = StreamProtocol("fast_tcp", framing.header(3), BinaryReceiver, BinarySender)
