"""A message that a port has received, as its owner sees it."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Any, TypeVar, overload

from rtf.errors import RtfError
from rtf.middleware.types.codecs import BOTTLE, codec_of, other_dialect

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Bottle, Dialect
    from rtf.middleware.types.codecs import Buffer, Codec
    from rtf.middleware.wire.outgoing_message import OutgoingMessage

T = TypeVar("T")
_NOTHING: tuple[Buffer, ...] = ()


class IncomingMessage:
    """A received message: its sender, its envelope, its contents, and the way to reply.

    ``read`` and ``reply`` may be called only by the thread that was given the message, and only until its callback
    returns: the data lie in a buffer that the next message reuses. ``wants_reply`` says whether the sender waits for a
    reply. ``dialect`` is the dialect that the sender is assumed to speak; ``read`` corrects it if the data only make
    sense in the other one.
    """

    __slots__ = ("_data", "_own", "_text", "answer", "dialect", "envelope", "sender", "wants_reply")

    def __init__(
        self,
        sender: str,
        envelope: str,
        data: Buffer,
        dialect: Dialect,
        wants_reply: bool,  # positional: keyword arguments would make this twice as slow
        text: bool,
        own: bool = False,
    ) -> None:
        self.sender = sender
        self.envelope = envelope
        self.wants_reply = wants_reply
        self._data = data
        self.dialect = dialect
        self._text = text
        self._own = own  # nothing else uses the data
        #: The bytes of the reply; read by the port.
        self.answer: Sequence[Buffer] = _NOTHING

    @overload
    def read(self) -> Bottle: ...
    @overload
    def read(self, codec: Codec[T]) -> T: ...
    def read(self, codec: Codec[Any] = BOTTLE) -> Any:
        """Decode the contents of the message. Raises an RtfError if the codec cannot decode them."""
        if self._text:
            return codec.from_text(bytes(self._data).decode("utf-8", "surrogateescape"))
        decode = codec.adopt if self._own else codec.decode
        try:
            return decode(self._data, self.dialect)
        except RtfError:
            # The wire format does not name the dialect; data that are invalid in one may be valid in the other.
            with contextlib.suppress(RtfError):
                value = decode(self._data, other_dialect(self.dialect))
                self.dialect = other_dialect(self.dialect)
                return value
            raise

    @property
    def size(self) -> int | None:
        """The number of bytes of the data; None if the object itself was passed within the process."""
        return len(self._data)

    def kept(self) -> IncomingMessage:
        """Return a copy that any thread may read at any time. It cannot be replied to."""
        return IncomingMessage(self.sender, self.envelope, bytes(self._data), self.dialect, False, self._text)

    def replaced(self, value: object) -> IncomingMessage:
        """Return this message with other contents, which have a codec."""
        codec = codec_of(value)
        if self._text:
            data = codec.to_text(value).encode("utf-8", "surrogateescape")
        else:
            data = b"".join(codec.encode(value, self.dialect))
        return IncomingMessage(self.sender, self.envelope, data, self.dialect, self.wants_reply, self._text, own=True)

    def as_reply(self, sender: str) -> IncomingMessage:
        """Return the reply that was set as a message."""
        data = b"".join(self.answer)
        return IncomingMessage(
            sender, "", data.rstrip(b"\r\n") if self._text else data, self.dialect, False, self._text
        )

    def reply(self, value: object, codec: Codec[object] | None = None) -> None:
        """Set the reply. Ignored without ``wants_reply``; the last call counts."""
        if not self.wants_reply:
            return
        codec = codec or codec_of(value)
        if self._text:
            self.answer = ((codec.to_text(value) + "\r\n").encode("utf-8", "surrogateescape"),)
        else:
            self.answer = codec.encode(value, self.dialect)


class LocalMessage(IncomingMessage):
    """A message from a port of the same process: the object itself, which neither side may change."""

    __slots__ = ("_message", "replied")

    def __init__(self, sender: str, message: OutgoingMessage) -> None:
        super().__init__(sender, message.envelope, b"", message.dialect, wants_reply=message.key == "d", text=False)
        self._message = message
        self.replied: tuple[object, Codec[object]] | None = None

    @overload
    def read(self) -> Bottle: ...
    @overload
    def read(self, codec: Codec[T]) -> T: ...
    def read(self, codec: Codec[Any] = BOTTLE) -> Any:
        """Return the object; encode and decode it once if it was sent with another codec."""
        message = self._message
        if message.codec is codec:
            return message.value
        return codec.decode(b"".join(message.blocks), message.dialect)

    @property
    def size(self) -> int | None:
        return None

    def kept(self) -> IncomingMessage:
        return self

    def reply(self, value: object, codec: Codec[object] | None = None) -> None:
        if self.wants_reply:
            self.replied = (value, codec or codec_of(value))
