"""What a carrier is: a handshake, and the two ends of a connection that come of it.

An *input link* is the end that receives messages and answers them, an *output link* the end that sends. Each is used by
one thread at a time; ``close`` may come from any. All of them raise MiddlewareError and its leaves, and nothing else,
for whatever a peer does.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

from rtf.bottle import BottleError
from rtf.middleware.codecs import other_dialect

if TYPE_CHECKING:
    import socket as sockets
    from collections.abc import Sequence

    from rtf.bottle import Dialect
    from rtf.middleware.codecs import Codec
    from rtf.middleware.names import Contact
    from rtf.middleware.outgoing import Outgoing
    from rtf.middleware.port import Port
    from rtf.middleware.stream import Stream

Buffer: TypeAlias = "bytes | bytearray | memoryview"
#: A message as it arrives: the letter of its command, the text that came with it (an envelope, a name), and the data.
Message: TypeAlias = "tuple[str, str, Buffer]"


class InputLink(ABC):
    """The receiving end. ``sender`` is the port at the other end, ``modifiers`` what stood in lists behind its name."""

    carrier: Carrier
    sender: str
    modifiers: str = ""
    #: Messages up to this many bytes lie in memory that is used again; larger ones are whoever's they are given to.
    reuses: float = float("inf")
    endpoint: sockets.socket | None = None

    def welcome(self, stream: Stream, port: Port) -> None:  # noqa: B027 - some carriers have no reply to the handshake
        """Reply to the handshake. Called once, when the port counts the caller among its inputs.

        So a peer that has connected finds itself there. In the thread of the connection.
        """

    @abstractmethod
    def receive(self) -> Message:
        """Wait for the next message. Its data may lie in a buffer that is used again for the next one.

        Raises StreamClosedError at the end of the connection.
        """

    @abstractmethod
    def answer(self, *reply: Buffer) -> None:
        """Be done with the message that was received last: send the reply, and the acknowledgement if one is due."""

    @abstractmethod
    def close(self) -> None:
        """End the connection, and any wait in it. Doing so again changes nothing."""

    def release(self) -> None:  # noqa: B027 - most have nothing to do
        """Give back what could not be while a thread was waiting in it. Called once, by that thread, at its end."""


class GatheredLink(InputLink):
    """A receiving end that can also be read without waiting, so that one thread may read many."""

    @abstractmethod
    def fill(self) -> None:
        """Take in what has come, if anything has. Raises StreamClosedError at the end of the connection."""

    @abstractmethod
    def missing(self) -> int:
        """How many bytes of the next message are still to come, as far as can be said; 0: ``receive`` will not wait."""

    @abstractmethod
    def acknowledge(self, count: int) -> None:
        """Be done with so many messages that have no reply, at once. Raises WaitTimeoutError rather than wait."""


class OutputLink(ABC):
    """The sending end."""

    carrier: Carrier
    endpoint: sockets.socket | None = None

    @abstractmethod
    def send(self, message: Outgoing) -> None:
        """Send one message. It may not have arrived yet."""

    def send_all(self, messages: Sequence[Outgoing]) -> None:
        """Send several that want no reply, which ``finish`` then waits for; each when the one before is dealt with.

        Carriers that can send several before the first has been dealt with, do.
        """
        for message in messages:
            self.finish()
            self.send(message)

    @abstractmethod
    def receive_reply(self, codec: Codec[Any], dialect: Dialect) -> object | None:
        """The reply to the message that was sent last; None when the peer had none to give."""

    def receive_reply_in_any(self, codec: Codec[Any], expected: Dialect) -> tuple[object | None, Dialect]:
        """The same in the dialect that is expected, or else in the other; returns the one that the peer speaks, too."""
        try:
            return self.receive_reply(codec, expected), expected
        except BottleError:
            other = other_dialect(expected)  # what makes no sense in the one is still there to be read
            return self.receive_reply(codec, other), other

    @abstractmethod
    def finish(self) -> None:
        """Wait until the message that was sent last has been dealt with, if the carrier tells."""

    @abstractmethod
    def limit_waiting(self, seconds: float | None) -> None:
        """Let waiting for the peer raise WaitTimeoutError after so many seconds; None: wait for ever."""

    @abstractmethod
    def close(self, *, politely: bool = True) -> None:
        """End the connection; ``politely`` says so to the peer first. Doing so again changes nothing."""


class Carrier(ABC):
    """A kind of connection. One object serves all of a process; it keeps nothing."""

    name: ClassVar[str]
    #: The eight bytes by which a connection of this kind begins.
    header: ClassVar[bytes]
    acknowledged: ClassVar[bool] = False
    #: Messages are datagrams: nobody hears when the other end is gone, and it has to be told by another way.
    connectionless: ClassVar[bool] = False
    #: Data are text, a line each.
    text: ClassVar[bool] = False

    def matches(self, header: bytes) -> bool:
        """Whether a connection that begins with these eight bytes is of this kind."""
        return header == self.header

    @abstractmethod
    def accept(self, stream: Stream, port: Port) -> InputLink:
        """Answer the handshake of a peer whose eight bytes have been read; ``port`` is the one that was called."""

    @abstractmethod
    def connect(self, stream: Stream, port: Port, target: Contact) -> OutputLink:
        """Make the handshake with a port that has been reached, in the name of one of ours."""
