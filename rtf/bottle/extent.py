"""Finds where a binary bottle ends without building it, also while its bytes are still arriving.

Replies and the messages of some carriers have no frame: the bottle itself tells where it ends. :class:`Scanner` reads
codes, counts and lengths once, whatever the pieces in which they come, and keeps its place in between; so a peer that
sends byte by byte costs no more than one that does not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle.containers import MAX_DEPTH
from rtf.bottle.errors import BottleError, BottleLimitError, BottleSyntaxError
from rtf.bottle.tags import DICT, GROUP, LIST, MAX_ELEMENTS, TAGS, TruncatedBottleError, int32, pair
from rtf.bottle.values import Dialect, Kind

if TYPE_CHECKING:
    from rtf.bottle.tags import Tags

_TEXTS = (Kind.STRING, Kind.BLOB)


def extent(data: bytes | bytearray | memoryview, start: int = 0, dialect: Dialect = Dialect.YARP3) -> int:
    """Where the bottle that begins at ``start`` ends. Raises what :func:`~rtf.bottle.binary.decode_from` raises."""
    return Scanner(dialect, start).end(data)


def possible_dialects(data: bytes | bytearray | memoryview) -> tuple[Dialect, ...]:
    """The dialects in which these bytes are exactly one bottle.

    A bottle without floats is one in both. With a float it nearly always is in one only, the peer's: 4.0's double has
    a code that 3 does not know, and 3's double is 4.0's float with four bytes too many. A peer's dialect is known as
    soon as one of its bottles is possible in one dialect only. None at all: the bytes are no whole bottle.
    """
    return tuple(dialect for dialect in Dialect if _is_bottle(data, dialect))


def _is_bottle(data: bytes | bytearray | memoryview, dialect: Dialect) -> bool:
    try:
        return extent(data, 0, dialect) == len(data)
    except BottleError:
        return False


class Scanner:
    """One bottle, from ``start`` of the bytes on. Of a bottle that was cut off, ``end`` goes on where it stopped."""

    __slots__ = ("_at", "_elements", "_lists", "_start", "_tags")

    def __init__(self, dialect: Dialect = Dialect.YARP3, start: int = 0) -> None:
        self._tags: Tags = TAGS[dialect]
        self._start = start
        self._at = start
        self._elements = 0
        #: Of each list that is open: how many elements are left, and the code of each, or 0.
        self._lists: list[tuple[int, int]] | None = None

    def end(self, data: bytes | bytearray | memoryview) -> int:
        """Where the bottle ends. ``data`` are all bytes that there are now, those of the last call at their places.

        Raises :class:`TruncatedBottleError` when it needs more, :class:`BottleError` when it is none; then it is done.
        """
        if self._lists is None:
            code, count = pair.unpack_from(data, self._reach(data, self._at, pair.size))
            if code & self._tags.not_list or not code & GROUP:
                raise BottleSyntaxError(f"{code} is not the code of a list", self._at)
            self._lists = []
            self._at += pair.size
            self._open(count, code & self._tags.unit)
        while self._lists:
            count, code = self._lists.pop()
            self._walk(data, count, code)
        return self._reach(data, self._at, 0)

    def _walk(self, data: bytes | bytearray | memoryview, count: int, sub: int) -> None:
        """Pass over elements, until the list ends or another one begins; if cut off, leave the place to go on at."""
        lists, sizes, at = self._lists, self._tags.sizes, self._at
        assert lists is not None
        size = sizes.get(sub)
        if size is not None:
            self._at += count * size
            return
        try:
            # The least that is missing: four bytes an element. Said at once, it spares waiting for each of them.
            self._reach(data, at, 4 * count)
            while count:
                code, body = (sub, at) if sub else self._code(data, at)
                size = sizes.get(code)
                if size is not None:
                    at = body + size
                elif code in _TEXTS:
                    (length,) = int32.unpack_from(data, self._reach(data, body, 4))
                    if length < 0:
                        raise BottleSyntaxError(f"a length of {length} bytes", body)
                    at = body + 4 + length
                else:
                    inner, many, at = self._inner(data, code, body)
                    lists.append((count - 1, sub))
                    self._at = at
                    self._open(many, inner)
                    return
                count -= 1
        except TruncatedBottleError:
            lists.append((count, sub))
            self._at = at
            raise
        self._at = at

    def _code(self, data: bytes | bytearray | memoryview, at: int) -> tuple[int, int]:
        (code,) = int32.unpack_from(data, self._reach(data, at, 4))
        return code, at + 4

    def _inner(self, data: bytes | bytearray | memoryview, code: int, at: int) -> tuple[int, int, int]:
        """Of a list or a property inside: the code of its elements, their number, and where they begin."""
        if code & DICT and not code & ~GROUP:
            inner, count = pair.unpack_from(data, self._reach(data, at, pair.size))
            if not inner & GROUP or inner & self._tags.not_list:
                raise BottleSyntaxError(f"{inner} is not the code of a list", at)
            return inner & self._tags.unit, count, at + pair.size
        if not code & LIST or code & ~(LIST | self._tags.unit):
            raise BottleSyntaxError(f"{code} is not the code of a value", at)
        (count,) = int32.unpack_from(data, self._reach(data, at, 4))
        return code & self._tags.unit, count, at + 4

    def _open(self, count: int, sub: int) -> None:
        assert self._lists is not None
        if sub not in self._tags.sizes:  # elements of a fixed size are passed over all at once
            self._elements += count
        if count < 0 or self._elements > MAX_ELEMENTS:
            raise BottleLimitError(f"a list of {count} elements is too long for a message")
        if len(self._lists) > MAX_DEPTH:
            raise BottleLimitError(f"a bottle is nested more than {MAX_DEPTH} levels deep")
        self._lists.append((count, sub))

    def _reach(self, data: bytes | bytearray | memoryview, at: int, size: int) -> int:
        """Make sure that so many bytes are there; returns ``at``."""
        if at + size > len(data):
            raise TruncatedBottleError(at + size - self._start)
        return at
