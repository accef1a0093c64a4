"""What the two ends of a connection have in common that goes over a stream, whatever is said there."""

from __future__ import annotations

import contextlib
from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar

from rtf.bottle.binary import TruncatedBottleError
from rtf.middleware.carriers.base import Buffer, Carrier, InputLink, OutputLink
from rtf.middleware.codecs import Arriving
from rtf.middleware.errors import MiddlewareError

if TYPE_CHECKING:
    from rtf.bottle import Dialect
    from rtf.middleware.codecs import Codec
    from rtf.middleware.stream import Stream

#: Seconds that a peer has to take its leave.
_PATIENCE = 1.0


class StreamInput(InputLink):
    """The receiving end."""

    #: What is sent when a message has been dealt with, by carriers that acknowledge.
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
    """The sending end. ``_due`` says whether, or how many, acknowledgements are still to come."""

    def __init__(self, carrier: Carrier, stream: Stream, no_reply: bytes = b"") -> None:
        self.carrier = carrier
        self.endpoint = stream.socket
        self._stream = stream
        self._acknowledged = carrier.acknowledged
        self._no_reply = no_reply  # by which a peer begins that has no reply to give
        self._due = 0

    def receive_reply(self, codec: Codec[object], dialect: Dialect) -> object | None:
        """See the base. A reply has no frame: it is read until it is whole."""
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
                # Nearly always all of it is there, and nothing has to be remembered of what was read already.
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
            with contextlib.suppress(MiddlewareError, OSError):  # it is gone already, which is what was wanted
                self._stream.limit_waiting(_PATIENCE)
                self._take_leave()
        self._stream.close()

    @abstractmethod
    def _take_leave(self) -> None:
        """Tell the peer that this is the end."""
