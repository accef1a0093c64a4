"""Base classes of the two ends of a connection over a stream, for any protocol."""

from __future__ import annotations

import contextlib
from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar

from rtf.bottle.binary import TruncatedBottleError
from rtf.middleware.carriers.base import Carrier, InputLink, OutputLink
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.types.codecs import Arriving, Buffer

if TYPE_CHECKING:
    from rtf.bottle import Dialect
    from rtf.middleware.carriers.stream import Stream
    from rtf.middleware.types.codecs import Codec

#: Seconds that a peer has to answer the end of a connection.
_PATIENCE = 1.0


class StreamInput(InputLink):
    """The receiving end."""

    #: The acknowledgement of a message, for carriers that have one.
    acknowledgement: ClassVar[bytes]

    def __init__(self, carrier: Carrier, stream: Stream, sender: str, modifiers: str) -> None:
        self.carrier = carrier
        self.sender = sender
        self.modifiers = modifiers
        self.endpoint = stream.socket
        self._stream = stream
        self._acknowledged = carrier.acknowledged

    def answer(self, *reply: Buffer) -> None:
        if self._acknowledged:
            self._stream.send(*reply, self.acknowledgement)
        elif reply:
            self._stream.send(*reply)

    def close(self) -> None:
        self._stream.close()


class StreamOutput(OutputLink):
    """The sending end. ``_due`` is whether, or how many, acknowledgements are outstanding."""

    def __init__(self, carrier: Carrier, stream: Stream, no_reply: bytes = b"") -> None:
        self.carrier = carrier
        self.endpoint = stream.socket
        self._stream = stream
        self._acknowledged = carrier.acknowledged
        self._no_reply = no_reply  # the first bytes of a peer that has no reply
        self._due = 0

    def receive_reply(self, codec: Codec[object], dialect: Dialect) -> object | None:
        """Return the reply. It has no length prefix: it is read until it is complete."""
        stream = self._stream
        no_reply = self._no_reply
        if stream.start == stream.end:
            stream.more()
        arriving: Arriving[object] | None = None
        while True:
            window = stream.view[stream.start : stream.end]
            if no_reply and stream.memory.startswith(no_reply, stream.start, stream.end):
                return None
            try:
                # Usually the reply is complete, and no partial scan has to be remembered.
                reply, size = arriving.read(window) if arriving else codec.decode_from(window, dialect)
            except TruncatedBottleError as error:
                arriving = arriving or Arriving(codec, dialect)
                stream.more_towards(error.needed)
                continue
            stream.start += size
            return reply

    def limit_waiting(self, seconds: float | None) -> None:
        self._stream.limit_waiting(seconds)

    def close(self, *, politely: bool = True) -> None:
        if politely:
            with contextlib.suppress(MiddlewareError, OSError):  # the peer is gone already
                self._stream.limit_waiting(_PATIENCE)
                self._send_quit()
        self._stream.close()

    @abstractmethod
    def _send_quit(self) -> None:
        """Send the quit command of the protocol."""
