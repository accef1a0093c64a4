"""A message that has arrived, as its port's owner sees it."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Any, TypeVar, overload

from rtf.errors import RtfError
from rtf.middleware.codecs import BOTTLE, codec_of, other_dialect

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Bottle, Dialect
    from rtf.middleware.carriers.base import Buffer
    from rtf.middleware.codecs import Codec
    from rtf.middleware.outgoing import Outgoing

T = TypeVar("T")
_NOTHING: tuple[Buffer, ...] = ()


class Delivery:
    """One message: whom it is from, its envelope, what it holds, and the way to reply.

    ``read`` and ``reply`` are for the thread that was given the delivery, and before it returns it: the data lie in a
    buffer that the next message will use. ``wants_reply`` says whether the sender waits for one.
    ``dialect`` is the one that the sender is taken to speak; reading may find out that it is the other one.
    """

    __slots__ = ("_data", "_own", "_text", "answer", "dialect", "envelope", "sender", "wants_reply")

    def __init__(
        self,
        sender: str,
        envelope: str,
        data: Buffer,
        dialect: Dialect,
        wants_reply: bool,  # in order, as a keyword each would make this twice as slow
        text: bool,
        own: bool = False,
    ) -> None:
        self.sender = sender
        self.envelope = envelope
        self.wants_reply = wants_reply
        self._data = data
        self.dialect = dialect
        self._text = text
        self._own = own  # nobody else will use the data
        #: The bytes of the reply. For the port.
        self.answer: Sequence[Buffer] = _NOTHING

    @overload
    def read(self) -> Bottle: ...
    @overload
    def read(self, codec: Codec[T]) -> T: ...
    def read(self, codec: Codec[Any] = BOTTLE) -> Any:
        """What the message holds. Raises a RtfError when it is something else."""
        if self._text:
            return codec.from_text(bytes(self._data).decode("utf-8", "surrogateescape"))
        decode = codec.adopt if self._own else codec.decode
        try:
            return decode(self._data, self.dialect)
        except RtfError:
            # Nothing on the wire says which dialect a peer speaks; what makes no sense in one may do so in the other.
            with contextlib.suppress(RtfError):
                value = decode(self._data, other_dialect(self.dialect))
                self.dialect = other_dialect(self.dialect)
                return value
            raise

    @property
    def size(self) -> int | None:
        """How many bytes it is long; None when the object itself was handed over."""
        return len(self._data)

    def kept(self) -> Delivery:
        """The same message, to be read at any time and by any thread; there is no replying to it any more."""
        return Delivery(self.sender, self.envelope, bytes(self._data), self.dialect, False, self._text)

    def reply(self, value: object, codec: Codec[object] | None = None) -> None:
        """Give the reply; without ``wants_reply`` nobody hears it. The last one counts."""
        if not self.wants_reply:
            return
        codec = codec or codec_of(value)
        if self._text:
            self.answer = ((codec.to_text(value) + "\r\n").encode("utf-8", "surrogateescape"),)
        else:
            self.answer = codec.encode(value, self.dialect)


class HandedOver(Delivery):
    """A message from a port of this process: the object itself, which neither side may change."""

    __slots__ = ("_message", "replied")

    def __init__(self, sender: str, message: Outgoing) -> None:
        super().__init__(sender, message.envelope, b"", message.dialect, wants_reply=message.key == "d", text=False)
        self._message = message
        self.replied: tuple[object, Codec[object]] | None = None

    @overload
    def read(self) -> Bottle: ...
    @overload
    def read(self, codec: Codec[T]) -> T: ...
    def read(self, codec: Codec[Any] = BOTTLE) -> Any:
        """The object; written and read once if it was sent as something else."""
        message = self._message
        if message.codec is codec:
            return message.value
        return codec.decode(b"".join(message.blocks), message.dialect)

    @property
    def size(self) -> int | None:
        return None

    def kept(self) -> Delivery:
        return self

    def reply(self, value: object, codec: Codec[object] | None = None) -> None:
        if self.wants_reply:
            self.replied = (value, codec or codec_of(value))
