"""``unix_stream``: binary messages without an index.

A port command is followed by the data, which are a bottle byte for byte and so self-delimiting.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Dialect
from rtf.bottle.binary import TruncatedBottleError
from rtf.bottle.errors import BottleSyntaxError
from rtf.bottle.extent import Scanner
from rtf.middleware.errors import ProtocolError
from rtf.middleware.types.codecs import other_dialect
from rtf.middleware.wire import framing
from rtf.middleware.wire.inbox import CHUNK
from rtf.middleware.wire.protocol import Receiver, Sender

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.types.codecs import Buffer
    from rtf.middleware.wire.inbox import Reading
    from rtf.middleware.wire.outgoing_message import OutgoingMessage
    from rtf.middleware.wire.protocol import Messages

_ACK = b"ACK\0"


class UnframedReceiver(Receiver):
    """The receiving end. ``dialect`` is the first guess at that of the data, corrected if it makes no sense."""

    reuses = CHUNK
    acknowledgement = _ACK
    dialect = Dialect.YARP3

    def messages(self) -> Messages:
        inbox = self.inbox
        while True:
            while inbox.unread < framing.COMMAND_SIZE:
                yield framing.COMMAND_SIZE
            size = framing.COMMAND_SIZE + framing.command_text_size(inbox.window()[: framing.COMMAND_SIZE])
            while inbox.unread < size:
                yield size
            key, text, _ = framing.read_command(bytes(inbox.window()[:size]))
            if key in ("d", "D", "a"):
                end = yield from self._end_of_bottle(size)
                yield key, text, inbox.pop(end)[size:]
            else:
                inbox.pop(size)
                yield key, text, b""

    def _end_of_bottle(self, start: int) -> Reading[int]:
        """Wait until the bottle at ``start`` of the window is complete. Return its end offset."""
        inbox = self.inbox
        scanner = Scanner(self.dialect, start)
        other: Dialect | None = other_dialect(self.dialect)
        while True:
            try:
                return scanner.end(inbox.window())
            except TruncatedBottleError as error:
                needed = error.needed
            except BottleSyntaxError:
                if other is None:
                    raise
                # The bottle may be in the other dialect; then the sender speaks that one.
                scanner, self.dialect, other = Scanner(other, start), other, None
                continue
            while inbox.unread < needed:
                yield needed


class UnframedSender(Sender):
    """The sending end."""

    no_reply = _ACK

    def message(self, message: OutgoingMessage) -> Sequence[Buffer]:
        self.due += self.acknowledged
        return (framing.command(message.key, message.envelope), *message.blocks)

    def acknowledgements(self) -> int:
        while self.due:
            if self.inbox.unread < len(_ACK):
                return len(_ACK)
            if self.inbox.pop(len(_ACK)) != _ACK:
                raise ProtocolError("the peer did not send an acknowledgement")
            self.due -= 1
        return 0

    def end(self) -> bytes:
        return framing.command_text("q")
