"""The interface of a carrier: a handshake, and the two ends of the connection that it returns.

An *input link* is the end that receives messages and replies, an *output link* the end that sends. Each is used by one
thread at a time; ``close`` may be called by any. For any behaviour of a peer, all of them raise only MiddlewareError
and its subclasses. Those of a connection over a stream are in :mod:`rtf.middleware.carriers.stream_carrier`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from rtf.bottle import BottleError
from rtf.middleware.errors import ConnectError, ProtocolError
from rtf.middleware.types.codecs import other_dialect

if TYPE_CHECKING:
    import socket as sockets
    from collections.abc import Callable, Sequence

    from rtf.bottle import Dialect
    from rtf.middleware.carriers.stream import Stream
    from rtf.middleware.types.codecs import Buffer, Codec
    from rtf.middleware.wire.contact import Contact
    from rtf.middleware.wire.outgoing_message import OutgoingMessage
    from rtf.middleware.wire.page import Page
    from rtf.middleware.wire.protocol import Caller, Message


class CarrierNetwork(Protocol):
    """What a carrier uses of the network of a port."""

    @property
    def dialect(self) -> Dialect: ...

    @property
    def report(self) -> Callable[[str], object]: ...
    @property
    def keyboard(self) -> int | None: ...

    def reach(self, target: Contact, patience: float | None = None) -> Stream:
        """Open a connection to an address. Raises ConnectError."""


class CarrierPort(Protocol):
    """What a carrier uses of the port on whose behalf it connects, or which was called."""

    @property
    def name(self) -> str: ...
    @property
    def contact(self) -> Contact: ...
    @property
    def network(self) -> CarrierNetwork: ...
    @property
    def closed(self) -> bool: ...
    @property
    def allows_outputs(self) -> bool: ...

    def hand_over(self, sender: str, message: OutgoingMessage) -> tuple[object, Codec[object]] | None:
        """Deliver an object of a port of this process, in that port's thread. Return the reply and its codec."""

    def multicast_group(self, interface: str) -> Group:
        """Return the multicast group that the port sends to on an interface. The first call creates it."""

    def page(self) -> Page:
        """Return what the port shows of itself in a browser."""


class InputLink(ABC):
    """The receiving end, usually of a connection over a stream.

    ``sender`` is the port at the other end, ``modifiers`` the text behind its name.
    """

    #: Messages up to this many bytes are in memory that is reused; larger ones belong to the receiver.
    reuses: float = float("inf")

    def __init__(self, carrier: Carrier, stream: Stream, caller: Caller) -> None:
        self.carrier = carrier
        self.sender, self.modifiers = caller
        self.endpoint: sockets.socket | None = stream.socket
        self._stream = stream

    def welcome(self, stream: Stream, port: CarrierPort) -> None:  # noqa: B027 - some carriers have no reply to the handshake
        """Reply to the handshake. Called once, when the port counts the caller among its inputs.

        So a peer that has connected finds itself there. In the thread of the connection.
        """

    @abstractmethod
    def receive(self) -> Message:
        """Wait for the next message. Its data may be in a buffer that the next message reuses.

        Raises StreamClosedError at the end of the connection.
        """

    def answer(self, *reply: Buffer) -> None:  # noqa: B027 - some carriers have neither
        """Finish the last received message: send the reply, and the acknowledgement if the carrier has one."""

    def reversed(self, stream: Stream) -> OutputLink:  # noqa: ARG002 - for carriers that can
        """Return an output that uses this connection from now on. Raises ProtocolError if the carrier is one-way."""
        raise ProtocolError(f"a connection by {self.carrier.name} cannot be reversed; tcp and text can")

    def close(self) -> None:
        """End the connection and any wait in it. A second call has no effect."""
        self._stream.close()

    def release(self) -> None:  # noqa: B027 - most have nothing to do
        """Release resources that a waiting thread still used. Called once, by that thread, at its end."""


class OutputLink(ABC):
    """The sending end, usually of a connection over a stream."""

    def __init__(self, carrier: Carrier, stream: Stream) -> None:
        self.carrier = carrier
        self.endpoint: sockets.socket | None = stream.socket
        self._stream = stream

    @abstractmethod
    def send(self, message: OutgoingMessage) -> None:
        """Send a message. It may not have arrived when this returns."""

    def send_all(self, messages: Sequence[OutgoingMessage]) -> None:
        """Send several messages without replies; ``finish`` then waits for all of them.

        The default sends each after the previous one is acknowledged; carriers that can pipeline override it.
        """
        for message in messages:
            self.finish()
            self.send(message)

    def receive_reply(self, codec: Codec[Any], dialect: Dialect) -> object | None:  # noqa: ARG002
        """Return the reply to the last message; None, the default, if the peer had none."""
        return None

    def receive_reply_in_any(self, codec: Codec[Any], expected: Dialect) -> tuple[object | None, Dialect]:
        """Return the reply and the peer's dialect: the expected one, else the other one."""
        try:
            return self.receive_reply(codec, expected), expected
        except BottleError:
            other = other_dialect(expected)  # the bytes that are invalid in one dialect are still unread
            return self.receive_reply(codec, other), other

    def finish(self) -> None:  # noqa: B027 - for carriers that have acknowledgements
        """Wait for the acknowledgement of the last message, if the carrier has one."""

    def limit_waiting(self, seconds: float | None) -> None:
        """Set the timeout in seconds after which a wait raises WaitTimeoutError; None: no timeout."""
        self._stream.limit_waiting(seconds)

    def close(self, *, politely: bool = True) -> None:  # noqa: ARG002 - for carriers that notify the peer
        """End the connection; ``politely`` notifies the peer first. A second call has no effect."""
        self._stream.close()


@dataclass(slots=True)
class Group:
    """The multicast group of a port: each message is sent once for all receivers, by the first member."""

    contact: Contact
    members: list[OutputLink] = field(default_factory=list)


class Carrier(ABC):
    """A kind of connection. One stateless object serves the whole process."""

    name: str
    #: The eight bytes with which a connection of this kind begins.
    header: bytes
    acknowledged: bool = False
    #: Messages are datagrams: the end of the connection cannot be seen, and is signalled over another connection.
    connectionless: bool = False
    #: Data are lines of text.
    text: bool = False
    #: Messages are encoded in the dialect of the reader; else the reader gets text, objects or pictures.
    has_dialects: bool = True
    #: The first eight bytes are the start of the first message: ``accept`` finds them unread.
    keeps_header: bool = False
    #: The port that receives opens the connection, and ``pull_from`` performs the handshake.
    pull: bool = False

    def matches(self, header: bytes) -> bool:
        """Return whether a connection with this header is of this kind."""
        return header == self.header

    @abstractmethod
    def accept(self, stream: Stream, port: CarrierPort) -> InputLink:
        """Answer the handshake of a peer whose header has been read; ``port`` is the port that it called."""

    def connect(self, stream: Stream, port: CarrierPort, target: Contact) -> OutputLink:  # noqa: ARG002
        """Perform the handshake with a port that is connected, on behalf of ``port``.

        Raises ConnectError if ports do not send by this carrier.
        """
        raise ConnectError(f"{target.name} cannot be connected by {self.name}, which only readers open; use tcp")

    def pull_from(self, stream: Stream, source: Contact) -> InputLink:  # noqa: ARG002 - for carriers that pull
        """Perform the handshake with a port that is connected, to receive from it.

        Raises ConnectError if the carrier is not one of ``pull``.
        """
        raise ConnectError(f"{self.name} is not a carrier by which a port asks for messages")
