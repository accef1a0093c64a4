"""The decoder of binary bottles. Every count and length is checked against the bytes that are there.

The decoder assumes that the bottle is complete, and checks for the end of the bytes only where reading past it would
not be noticed. When it meets the end, :mod:`rtf.bottle.extent` computes how much is missing.
"""

from __future__ import annotations

import struct

from rtf.bottle.bottle import Bottle
from rtf.bottle.containers import MAX_DEPTH, Value
from rtf.bottle.errors import BottleLimitError, BottleSyntaxError
from rtf.bottle.extent import extent
from rtf.bottle.property import Property
from rtf.bottle.tags import (
    DICT,
    GROUP,
    LIST,
    MAX_ELEMENTS,
    TAGS,
    Scalar,
    Tags,
    TruncatedBottleError,
    int32,
    pair,
    several,
    vocabs,
)
from rtf.bottle.values import Dialect

_INT32, _STRING, _VOCAB32, _BLOB = 1, 4, 9, 12
_TEXTS = (_STRING, _BLOB)
_double = struct.Struct("<d")
_pair_at, _int32_at, _double_at = pair.unpack_from, int32.unpack_from, _double.unpack_from


class _CutOffError(Exception):
    """A length points past the end of the bytes."""


def decode(data: bytes | bytearray | memoryview, dialect: Dialect = Dialect.YARP3) -> Bottle:
    """Decode a bottle that fills ``data``. Raises :class:`BottleError` for anything else."""
    bottle, end = decode_from(data, 0, dialect)
    if end != len(data):
        raise BottleSyntaxError(f"{len(data) - end} bytes follow the bottle, which has {end}")
    return bottle


def decode_from(
    data: bytes | bytearray | memoryview, start: int = 0, dialect: Dialect = Dialect.YARP3
) -> tuple[Bottle, int]:
    """Decode the bottle at ``start``; return it and its end offset. Further bytes may follow.

    Raises :class:`TruncatedBottleError` if bytes are missing, :class:`BottleLimitError` for too many levels or
    elements, and :class:`BottleSyntaxError` for an unknown code.
    """
    if type(data) is bytearray:
        data = memoryview(data)  # a slice of a memoryview is not a copy
    tags = TAGS[dialect]
    try:
        code, count = _pair_at(data, start)
        alike = tags.lists.get(code)
        if alike is not None and 0 <= count <= MAX_ELEMENTS:
            # The fast path for the words of a command and the numbers of a vector, without a reader object.
            return Bottle.adopt(_scalars(data, start + 8, count, alike)), start + 8 + count * alike.size
        if code & tags.not_list or not code & GROUP:
            raise BottleSyntaxError(f"{code} is not the code of a list")
        items, end = _Reader(data, tags).items(count, code & tags.unit, start + 8, 0)
    except (struct.error, _CutOffError):
        end = extent(data, start, dialect)  # raises TruncatedBottleError with the number of needed bytes
        raise TruncatedBottleError(end) from None
    return Bottle.adopt(items), end


class _Reader:
    """The decoding of one bottle; ``left`` is how many elements it may still have, in all its lists."""

    __slots__ = ("data", "left", "size", "tags")

    def __init__(self, data: bytes | bytearray | memoryview, tags: Tags) -> None:
        self.data = data
        self.size = len(data)
        self.tags = tags
        self.left = MAX_ELEMENTS

    def items(self, count: int, sub: int, at: int, depth: int) -> tuple[list[Value], int]:
        """Decode the elements of a list; return them and the end. ``sub``: their common type, or 0 for mixed types."""
        self.left -= count
        if count < 0 or self.left < 0:
            raise BottleLimitError(f"a list of {count} elements is too long for a message")
        if depth > MAX_DEPTH:
            raise BottleLimitError(f"a bottle is nested more than {MAX_DEPTH} levels deep")
        return self._alike(count, sub, at) if sub else self._mixed(count, at, depth)

    def _mixed(self, count: int, at: int, depth: int) -> tuple[list[Value], int]:
        if at + 4 * count > self.size:
            raise _CutOffError
        # No helper functions, frequent types first: this loop dominates the time of an RPC. Eight bytes are read at
        # once, the code and usually a number, a length or a count; the last element may be shorter.
        data, size, float64 = self.data, self.size, self.tags.float64_code
        items: list[Value] = []
        append = items.append
        for _ in range(count):
            if at + 8 > size:
                value, at = self._element(_int32_at(data, at)[0], at + 4, depth)
                append(value)
                continue
            code, number = _pair_at(data, at)
            at += 8
            if code == _VOCAB32:
                append(vocabs[number])
            elif code == float64:
                append(_double_at(data, at - 4)[0])
                at += 4
            elif code == _INT32:
                append(number)
            elif code == _STRING:
                end = at + number
                if number < 0 or end > size:
                    raise _bad_length(number, at)
                append(str(data[at:end], "utf-8", "surrogateescape"))
                at = end
            elif code == LIST:
                inner, at = self.items(number, 0, at, depth + 1)
                append(Bottle.adopt(inner))
            else:
                value, at = self._element(code, at - 4, depth)
                append(value)
        return items, at

    def _alike(self, count: int, code: int, at: int) -> tuple[list[Value], int]:
        fixed = self.tags.fixed.get(code)
        if fixed is not None:
            return _scalars(self.data, at, count, fixed), at + count * fixed.size
        if at + 4 * count > self.size:
            raise _CutOffError
        if code in _TEXTS:
            return self._texts(count, code, at)
        if count:
            raise BottleSyntaxError(f"{code} is not the code of a value")
        return [], at

    def _texts(self, count: int, code: int, at: int) -> tuple[list[Value], int]:
        """Decode ``count`` strings or blobs, each after its length."""
        data, size = self.data, self.size
        items: list[Value] = []
        for _ in range(count):
            (length,) = _int32_at(data, at)
            at += 4
            end = at + length
            if length < 0 or end > size:
                raise _bad_length(length, at)
            raw = data[at:end]
            items.append(str(raw, "utf-8", "surrogateescape") if code == _STRING else bytes(raw))
            at = end
        return items, at

    def _element(self, code: int, at: int, depth: int) -> tuple[Value, int]:
        """Decode the element after its code; return it and the end."""
        fixed = self.tags.fixed.get(code)
        if fixed is not None:
            (value,) = fixed.one.unpack_from(self.data, at)
            return value if fixed.make is None else fixed.make(value), at + fixed.size
        if code in _TEXTS:
            texts, end = self._texts(1, code, at)
            return texts[0], end
        if code & DICT and not code & ~GROUP:
            inner, count = _pair_at(self.data, at)
            if not inner & GROUP or inner & self.tags.not_list:
                raise BottleSyntaxError(f"{inner} is not the code of a list")
            groups, end = self.items(count, inner & self.tags.unit, at + 8, depth + 1)
            return Property.from_bottle(Bottle.adopt(groups)), end
        if code & LIST and not code & ~(LIST | self.tags.unit):
            (count,) = _int32_at(self.data, at)
            items, end = self.items(count, code & self.tags.unit, at + 4, depth + 1)
            return Bottle.adopt(items), end
        raise BottleSyntaxError(f"{code} is not the code of a value")


def _scalars(data: bytes | bytearray | memoryview, at: int, count: int, scalar: Scalar) -> list[Value]:
    """Decode ``count`` elements of one type of fixed size."""
    values = several(count, scalar.letter).unpack_from(data, at)
    make = scalar.make
    return [*values] if make is None else [*map(make, values)]


def _bad_length(length: int, at: int) -> Exception:
    return BottleSyntaxError(f"a length of {length} bytes at byte {at - 4}") if length < 0 else _CutOffError()
