"""Pairs: two objects in one message, such as a command and the numbers that go with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

from rtf.bottle import BottleError, Dialect
from rtf.bottle.binary import LIST, TruncatedBottleError
from rtf.bottle.tags import pair as _head
from rtf.middleware.types.codecs import TextCodec, codec_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.types.codecs import Buffer, Codec

A = TypeVar("A")
B = TypeVar("B")
_HEAD = _head.pack(LIST, 2)


@dataclass(slots=True)
class Pair(Generic[A, B]):
    """Two objects that have codecs of their own."""

    first: A
    second: B

    @property
    def codec(self) -> PairCodec[A, B]:
        """The codec of the pair."""
        return PairCodec(codec_of(self.first), codec_of(self.second))


class PairCodec(TextCodec[Pair[A, B]]):
    """Codec of pairs: a list of two elements, each encoded by its own codec.

    ``PairCodec(BOTTLE, VECTOR)`` is the format of a robot's streamed commands.
    """

    def __init__(self, first: Codec[A], second: Codec[B]) -> None:
        self._first = first
        self._second = second

    def encode(self, value: Pair[A, B], dialect: Dialect) -> Sequence[Buffer]:
        """Return the header joined with the first block, and all further blocks."""
        head, *rest = self._first.encode(value.first, dialect)
        body = self._second.encode(value.second, dialect)
        if rest or len(body) > 1:
            return [b"".join((_HEAD, head)), *rest, *body]
        return (b"".join((_HEAD, head, *body)),)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[Pair[A, B], int]:
        first, second, rest = self._parts(data, dialect)
        try:
            value, end = self._second.decode_from(rest, dialect)
        except TruncatedBottleError as error:
            raise TruncatedBottleError(second + error.needed) from None
        return Pair(first, value), second + end

    def adopt(self, data: Buffer, dialect: Dialect) -> Pair[A, B]:
        """Decode a pair whose second object may be a view of the bytes."""
        first, _, rest = self._parts(data, dialect)
        return Pair(first, self._second.adopt(rest, dialect))

    def _parts(self, data: Buffer, dialect: Dialect) -> tuple[A, int, memoryview]:
        """Decode the first object; return it, the offset of the second, and the bytes from there on."""
        if len(data) < len(_HEAD):
            raise TruncatedBottleError(len(_HEAD))
        if data[: len(_HEAD)] != _HEAD:
            raise BottleError(f"a pair is a list of two; the message begins with {bytes(data[: len(_HEAD)])!r}")
        view = memoryview(data)[len(_HEAD) :]
        try:
            first, end = self._first.decode_from(view, dialect)
        except TruncatedBottleError as error:
            raise TruncatedBottleError(len(_HEAD) + error.needed) from None
        return first, len(_HEAD) + end, view[end:]
