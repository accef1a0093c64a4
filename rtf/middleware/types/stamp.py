"""Stamps: the number and the time of a message. They travel as its envelope, in text, or as an object."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from rtf.bottle import Bottle, BottleError, Dialect, Vocab, as_float, as_int
from rtf.bottle.binary import decode_from, encode
from rtf.bottle.values import INT32_MAX
from rtf.middleware.codecs import TextCodec

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.carriers.base import Buffer

_PARTS = (2, 3)
#: A longer text is no stamp.
_MAX_TEXT = 200


class StampCodec(TextCodec["Stamp"]):
    """A list of the count and the time."""

    def encode(self, value: Stamp, dialect: Dialect) -> Sequence[Buffer]:
        """One block."""
        return (encode(Bottle.adopt([value.count, value.time]), dialect),)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[Stamp, int]:
        """A list of two numbers; a third element is passed over."""
        bottle, end = decode_from(data, 0, dialect)
        stamp = _of(bottle)
        if stamp is None:
            raise BottleError(f"a stamp is a count and a time, {bottle.to_text()[:60]!r} came")
        return stamp, end

    def to_text(self, value: Stamp) -> str:
        """As envelopes are written."""
        return str(value)


@dataclass(frozen=True, slots=True)
class Stamp:
    """The number of a message, counted by its sender from 0, and when its contents were true, in seconds.

    A count of -1 stands for no stamp at all.
    """

    count: int = -1
    time: float = 0.0
    codec: ClassVar[StampCodec] = StampCodec()

    @staticmethod
    def parse(envelope: str) -> Stamp | None:
        """The stamp in an envelope; None when it is another text, or none."""
        # What is nearly always there needs no bottle.
        count, _, time = envelope.partition(" ")
        if count.isascii() and count.isdigit():
            try:
                return _checked(int(count), float(time))
            except ValueError:
                pass
        return _of(Bottle.parse(envelope)) if 0 < len(envelope) <= _MAX_TEXT else None

    @property
    def valid(self) -> bool:
        """Whether it is one."""
        return self.count >= 0

    def next(self, time: float) -> Stamp:
        """The stamp of the message after this one; after the greatest count comes 0."""
        return Stamp(self.count + 1 if 0 <= self.count < INT32_MAX else 0, time)

    def __str__(self) -> str:
        return f"{self.count} {self.time:.15g}"


def _of(bottle: Bottle) -> Stamp | None:
    if len(bottle) not in _PARTS or not all(isinstance(value, int | float | Vocab) for value in bottle[:2]):
        return None
    return _checked(as_int(bottle[0], 32), as_float(bottle[1]))


def _checked(count: int, time: float) -> Stamp | None:
    return Stamp(count, time) if -1 <= count <= INT32_MAX else None


STAMP = Stamp.codec
