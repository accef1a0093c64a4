"""The protocol of a connection over a stream: a greeting, and the two ends, as state machines on bytes.

A *receiver* is the end that gets messages and replies to them, a *sender* the end that sends them. Both are without a
socket. What waits is a generator, see :mod:`rtf.middleware.wire.inbox`; replies and acknowledgements, which are read
for each message, are functions that return how many bytes they wait for. Everything else returns the bytes to send.
A whole connection is for the side that accepts it ``greeting``, ``welcome`` and then ``messages``, with an ``answer``
after each; for the other side it is ``greet``, and for each message ``message``, ``reply`` if one is wanted, and
``acknowledgements``.
"""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, NamedTuple, TypeAlias

from rtf.bottle.binary import TruncatedBottleError
from rtf.bottle.errors import BottleSyntaxError
from rtf.bottle.extent import Scanner
from rtf.middleware.wire import framing

if TYPE_CHECKING:
    from collections.abc import Generator, Sequence

    from rtf.bottle import Dialect
    from rtf.middleware.types.codecs import Buffer, Codec
    from rtf.middleware.wire.inbox import Inbox, Reading, Steps
    from rtf.middleware.wire.outgoing_message import OutgoingMessage

#: A received message: the letter of its command, the text that came with it (an envelope, a name), and the data.
Message: TypeAlias = "tuple[str, str, Buffer]"
#: Messages as they arrive, without an end; an integer asks for so many unread bytes, as in ``Reading``.
Messages: TypeAlias = "Generator[int | Message, None, None]"
#: The size of the header with which a connection begins.
HEADER = 8


class Caller(NamedTuple):
    """The name of a connecting port, or a label; ``modifiers`` is the text behind it."""

    name: str
    modifiers: str = ""


@dataclass(frozen=True, slots=True)
class StreamProtocol:
    """A protocol of which greeting and messages are on one stream. ``header`` are its first eight bytes.

    ``acknowledged``: each message is acknowledged after it has been processed. ``text``: data are lines of text.
    """

    name: str
    header: bytes
    receiver: type[Receiver]
    sender: type[Sender]
    acknowledged: bool = False
    text: bool = False


class Receiver(ABC):
    """The end of a connection that receives messages."""

    #: Messages up to this many bytes are in memory that is reused; larger ones belong to the owner of the port.
    reuses: ClassVar[float] = float("inf")
    #: Messages have a length prefix, so the size of the next one is known before it has arrived.
    framed: ClassVar[bool] = False
    #: What is sent behind the reply when a message has been processed; empty if the protocol has no acknowledgements.
    acknowledgement: bytes = b""

    def __init__(self, inbox: Inbox, *, acknowledged: bool) -> None:
        self.inbox = inbox
        if not acknowledged:
            self.acknowledgement = b""

    def greeting(self) -> Reading[Caller]:
        """Read the caller, behind the header. The default is the name of the binary carriers, with a length prefix."""
        return read_caller(self.inbox)

    def welcome(self, caller: Caller, number: int) -> bytes:  # noqa: ARG002 - some protocols have none
        """Return the reply to the greeting; ``number`` is that of the called port."""
        return b""

    @abstractmethod
    def messages(self) -> Messages:
        """Receive messages. The data of one are valid until the next one is asked for, see ``reuses``.

        Raises ProtocolError, and BottleError where data delimit themselves.
        """


class Sender(ABC):
    """The end of a connection that sends messages. ``due`` is the number of outstanding acknowledgements."""

    #: The first bytes of a peer that has no reply.
    no_reply: ClassVar[bytes] = b""

    def __init__(self, inbox: Inbox, *, acknowledged: bool) -> None:
        self.inbox = inbox
        self.acknowledged = acknowledged
        self.due = 0
        #: The last reply; None if the peer had none.
        self.answer: object | None = None
        # Of a reply of which a part has arrived: the bytes that it needs, and how far it is scanned if it is a bottle.
        self._needed = 0
        self._scanner: Scanner | None = None

    def greet(self, header: bytes, name: str) -> Steps[None]:
        """Send the header and the name of the caller, with its modifiers, and read the answer if there is one."""
        yield header + framing.sender(name)

    @abstractmethod
    def message(self, message: OutgoingMessage) -> Sequence[Buffer]:
        """Return the bytes of a message. Large blocks are not copied."""

    def reply(self, codec: Codec[object], dialect: Dialect) -> int:
        """Read the reply to the last message into ``answer``, and return 0.

        If it has not arrived, return how many unread bytes to wait for before the next call. It has no length prefix:
        it is read until it is complete. After a BottleError its bytes are still unread.
        """
        inbox = self.inbox
        if self.no_reply and self.acknowledged and inbox.memory.startswith(self.no_reply, inbox.start, inbox.end):
            self._needed = 0
            self.answer = None
            return 0
        if inbox.end - inbox.start < (self._needed or 1):
            return self._needed or 1
        window = inbox.view[inbox.start : inbox.end]
        try:
            if self._needed and self._scanner is not None:
                self._scanner.end(window)
            self.answer, size = codec.decode_from(window, dialect)
        except TruncatedBottleError as error:
            if not self._needed:
                self._scanner = Scanner(dialect)  # so that no byte is looked at twice while more arrive
            self._needed = error.needed
            return self._needed
        except BottleSyntaxError:
            if self._needed and self._scanner is not None:
                self._scanner = None  # some replies of services are no bottles: only the codec knows where they end
                return self.reply(codec, dialect)
            self._needed = 0
            raise
        inbox.start += size
        self._needed = 0
        return 0

    @abstractmethod
    def acknowledgements(self) -> int:
        """Read the acknowledgements of all messages that were sent, and return 0.

        If they have not arrived, return how many unread bytes to wait for before the next call.
        """

    @abstractmethod
    def end(self) -> bytes:
        """Return the announcement that nothing follows."""


def read_caller(inbox: Inbox) -> Reading[Caller]:
    """Read the name of a binary carrier's sender, and the modifiers behind it."""
    (size,) = struct.unpack("<i", (yield from inbox.take(4)))
    raw = bytes((yield from inbox.take(min(max(size, 1), framing.MAX_NAME))))
    name, _, modifiers = raw.split(b"\0", 1)[0].decode("utf-8", "surrogateescape").partition(" ")
    return Caller(name, modifiers)


def read_header(inbox: Inbox) -> Reading[bytes]:
    """Read the header of a connection, without consuming it: for some carriers it is a part of the first message."""
    while inbox.unread < HEADER:
        yield HEADER
    return bytes(inbox.window()[:HEADER])
