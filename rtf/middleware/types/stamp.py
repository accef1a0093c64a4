"""Stamps: the number and the time of a message, sent as its envelope, in text, or as an object."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from rtf.bottle import Bottle, BottleError, Dialect, Vocab, as_float, as_int
from rtf.bottle.binary import decode_from, encode
from rtf.bottle.values import INT32_MAX
from rtf.middleware.types.codecs import TextCodec

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.types.codecs import Buffer

_PARTS = (2, 3)
#: The longest text of a stamp, in characters.
_MAX_TEXT = 200


class StampCodec(TextCodec["Stamp"]):
    """Codec of stamps: a list of the count and the time."""

    def encode(self, value: Stamp, dialect: Dialect) -> Sequence[Buffer]:
        """One block."""
        return (encode(Bottle.adopt([value.count, value.time]), dialect),)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[Stamp, int]:
        """Decode a list of two numbers; a third element is ignored."""
        bottle, end = decode_from(data, 0, dialect)
        stamp = _of(bottle)
        if stamp is None:
            raise BottleError(f"a stamp is a count and a time, not {bottle.to_text()[:60]!r}")
        return stamp, end

    def to_text(self, value: Stamp) -> str:
        """Return the text of an envelope."""
        return str(value)


@dataclass(frozen=True, slots=True)
class Stamp:
    """The number of a message, counted by its sender from 0, and the time of its contents, in seconds.

    A count of -1 means that there is no stamp.
    """

    count: int = -1
    time: float = 0.0
    codec: ClassVar[StampCodec] = StampCodec()

    @staticmethod
    def parse(envelope: str) -> Stamp | None:
        """Parse the stamp in an envelope; None if the text is empty or something else."""
        # the usual text needs no bottle parser
        count, _, time = envelope.partition(" ")
        if count.isascii() and count.isdigit():
            try:
                return _checked(int(count), float(time))
            except ValueError:
                pass
        return _of(Bottle.parse(envelope)) if 0 < len(envelope) <= _MAX_TEXT else None

    @property
    def valid(self) -> bool:
        """Whether the stamp is set."""
        return self.count >= 0

    def next(self, time: float) -> Stamp:
        """Return the stamp of the next message; the count after the maximum is 0."""
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
