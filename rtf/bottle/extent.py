"""The end of a binary bottle, found without decoding it, also while its bytes are still arriving.

Replies and the messages of some carriers have no length prefix: the bottle itself is self-delimiting. :class:`Scanner`
reads codes, counts and lengths once, in any pieces in which they arrive, and keeps its position in between; a
peer that sends byte by byte therefore costs no more than any other.
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
    """Return the end of the bottle at ``start``. Raises the errors of :func:`~rtf.bottle.binary.decode_from`."""
    return Scanner(dialect, start).end(data)


def possible_dialects(data: bytes | bytearray | memoryview) -> tuple[Dialect, ...]:
    """Return the dialects in which these bytes are exactly one bottle.

    A bottle without floats is valid in both. With a float it is nearly always valid in one only, the peer's: 4.0's
    double has a code unknown to 3, and 3's double is 4.0's float with four bytes too many. A peer's dialect is known as
    soon as one of its bottles is valid in one dialect only. An empty result: the bytes are not a complete bottle.
    """
    return tuple(dialect for dialect in Dialect if _is_bottle(data, dialect))


def _is_bottle(data: bytes | bytearray | memoryview, dialect: Dialect) -> bool:
    try:
        return extent(data, 0, dialect) == len(data)
    except BottleError:
        return False


class Scanner:
    """The scan of a bottle at ``start``. After a truncated bottle, ``end`` continues where it stopped."""

    __slots__ = ("_at", "_elements", "_lists", "_tags")

    def __init__(self, dialect: Dialect = Dialect.YARP3, start: int = 0) -> None:
        self._tags: Tags = TAGS[dialect]
        self._at = start
        self._elements = 0
        #: For each open list: how many elements are left, and the code of each, or 0.
        self._lists: list[tuple[int, int]] | None = None

    def end(self, data: bytes | bytearray | memoryview) -> int:
        """Return the end of the bottle. ``data`` is all bytes so far, including those of earlier calls.

        Raises :class:`TruncatedBottleError` if bytes are missing, :class:`BottleError` if it is invalid, after which
        the scanner cannot be used.
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
        """Skip elements until the list ends or another one begins. If truncated, store the position to continue at."""
        lists, sizes, at = self._lists, self._tags.sizes, self._at
        assert lists is not None
        size = sizes.get(sub)
        if size is not None:
            self._at += count * size
            return
        try:
            # At least four bytes per element must follow. Asking for all of them at once saves waiting for each.
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
        """Return the element code, the number of elements and the start of a nested list or property."""
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
        if sub not in self._tags.sizes:  # elements of a fixed size are skipped together
            self._elements += count
        if count < 0 or self._elements > MAX_ELEMENTS:
            raise BottleLimitError(f"a list of {count} elements is too long for a message")
        if len(self._lists) > MAX_DEPTH:
            raise BottleLimitError(f"a bottle is nested more than {MAX_DEPTH} levels deep")
        self._lists.append((count, sub))

    def _reach(self, data: bytes | bytearray | memoryview, at: int, size: int) -> int:
        """Check that ``size`` bytes exist at ``at``; return ``at``."""
        if at + size > len(data):
            raise TruncatedBottleError(at + size)
        return at
