"""The encoder of binary bottles."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any

from rtf.bottle.containers import MAX_DEPTH, Container, Value, kind_of
from rtf.bottle.errors import BottleLimitError
from rtf.bottle.tags import DICT, LIST, TAGS, int32, pair, several
from rtf.bottle.values import INT32_MAX, INT32_MIN, Dialect, Kind, Vocab, Vocab64, utf8

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle.tags import Scalar, Tags

#: From this size on a blob is passed on without a copy, in bytes.
LARGE_BLOB = 64 << 10
#: The largest number of blocks of a bottle; the kernel accepts about a thousand in one call.
MAX_BLOCKS = 200
_INT32, _STRING, _VOCAB32, _BLOB = 1, 4, 9, 12
#: The list codes of types that are not numbers of fixed size.
_ROWS: dict[type, int] = {str: _STRING, bytes: _BLOB, Vocab64: _VOCAB32}
_pack_pair = pair.pack
_pack_double = struct.Struct("<id").pack


def encode(bottle: Container, dialect: Dialect = Dialect.YARP3) -> bytes:
    """Encode a bottle, or a property as the bottle of its groups. Raises BottleError if it is nested too deeply."""
    items = bottle.elements()
    parts = [b""]
    sub = _Writer(TAGS[dialect], parts).items(items, 0)
    parts[0] = _pack_pair(LIST | sub, len(items))
    return b"".join(parts)


def encode_blocks(bottle: Container, dialect: Dialect = Dialect.YARP3) -> list[bytes]:
    """Encode to consecutive blocks: large blobs are blocks of their own and not copied. Otherwise as :func:`encode`."""
    items, tags = bottle.elements(), TAGS[dialect]
    # The fast path for the words of a command and the numbers of a vector, without a writer object.
    alike = None
    if items and type(items[0]) is type(items[-1]) and type(items[0]) in tags.numbers:
        alike = _scalars(items, tags)
    if alike is not None:
        (scalar, numbers), count = alike, len(items)
        return [several(count, scalar.letter, "ii").pack(LIST | scalar.code, count, *numbers)]
    parts = [b""]
    writer = _Writer(tags, parts)
    sub = writer.items(items, 0)
    parts[0] = _pack_pair(LIST | sub, len(items))
    large = writer.large[: MAX_BLOCKS // 2]
    if not large:
        return [b"".join(parts)]
    blocks: list[bytes] = []
    done = 0
    for index in large:
        blocks += b"".join(parts[done:index]), parts[index]
        done = index + 1
    rest = b"".join(parts[done:])
    return [*blocks, rest] if rest else blocks


def encode_element(value: Value, dialect: Dialect = Dialect.YARP3) -> bytes:
    """Encode a value as an element of a list of mixed types: its code, then the value."""
    parts: list[bytes] = []
    _Writer(TAGS[dialect], parts).element(value, 0)
    return b"".join(parts)


class _Writer:
    """The encoding of a bottle into ``parts``; ``large`` are the indexes of blobs that should not be copied."""

    __slots__ = ("large", "parts", "tags")

    def __init__(self, tags: Tags, parts: list[bytes]) -> None:
        self.tags = tags
        self.parts = parts
        self.large: list[int] = []

    def items(self, items: list[Value], depth: int) -> int:
        """Append the elements of a list; return their common code, or 0."""
        if depth > MAX_DEPTH:
            raise BottleLimitError(f"a bottle is nested more than {MAX_DEPTH} levels deep, or inside itself")
        if items and type(items[0]) is type(items[-1]):  # otherwise the types differ
            code = self._alike(items)
            if code:
                return code
        # No helper functions, frequent types first: this loop dominates the time of an RPC.
        append, float64 = self.parts.append, self.tags.float64_code
        for value in items:
            cls = type(value)
            if cls is Vocab:
                append(_pack_pair(_VOCAB32, value._value))  # type: ignore[union-attr]  # noqa: SLF001 - one package
            elif cls is float:
                append(_pack_double(float64, value))
            elif cls is str:
                raw = utf8(value)  # type: ignore[arg-type]
                append(_pack_pair(_STRING, len(raw)) + raw)
            elif cls is int and INT32_MIN <= value <= INT32_MAX:  # type: ignore[operator]
                append(_pack_pair(_INT32, value))
            else:
                self.element(value, depth)
        return 0

    def _alike(self, items: list[Value]) -> int:
        """Append the elements without codes and return their code, if they are scalars of one type; else return 0."""
        cls = type(items[0])
        if cls in self.tags.numbers:
            alike = _scalars(items, self.tags)
            if alike is None:
                return 0
            scalar, numbers = alike
            self.parts.append(several(len(items), scalar.letter).pack(*numbers))
            return scalar.code
        if len(items) > 1 and len(set(map(type, items))) > 1:
            return 0
        if cls is str:
            for value in items:
                raw = utf8(value)  # type: ignore[arg-type]
                self.parts.append(int32.pack(len(raw)) + raw)
        elif cls is bytes:
            for value in items:
                self._blob(int32.pack(len(value)), value)  # type: ignore[arg-type]
        elif cls is Vocab64:
            self.parts.append(several(len(items), "i").pack(*map(_first_word, items)))
        return _ROWS.get(cls, 0)

    def element(self, value: Value, depth: int) -> None:
        """Append one element of any type, with its code."""
        scalar = self.tags.classes.get(type(value))
        if isinstance(value, Container):
            items, here = value.elements(), len(self.parts)
            self.parts.append(b"")
            front = _pack_pair(LIST | self.items(items, depth + 1), len(items))
            self.parts[here] = front if value.kind is Kind.LIST else int32.pack(LIST | DICT) + front
        elif scalar is not None:
            number = int(value) if isinstance(value, Vocab) else value
            self.parts.append(scalar.with_code.pack(scalar.code, number))
        elif isinstance(value, str):
            raw = utf8(value)
            self.parts.append(_pack_pair(_STRING, len(raw)) + raw)
        elif isinstance(value, bytes):
            self._blob(_pack_pair(_BLOB, len(value)), value)
        elif isinstance(value, Vocab64):
            self.parts.append(_pack_pair(_VOCAB32, _first_word(value)))
        elif kind_of(value) is Kind.INT32:  # raises an error for an unsupported type
            self.parts.append(_pack_pair(_INT32, value))
        else:
            self.parts.append(self.tags.int64.with_code.pack(self.tags.int64.code, value))

    def _blob(self, head: bytes, raw: bytes) -> None:
        self.parts.append(head)
        if len(raw) >= LARGE_BLOB:
            self.large.append(len(self.parts))
        self.parts.append(raw)


def _scalars(items: list[Value], tags: Tags) -> tuple[Scalar, Sequence[Any]] | None:
    """Return the common type of elements if it is one of fixed size, and the numbers to encode; else None."""
    cls = type(items[0])
    if cls is Vocab:
        numbers: list[int] = []
        for value in items:
            if type(value) is not Vocab:
                return None
            numbers.append(value._value)  # noqa: SLF001 - one package
        return tags.classes[cls], numbers
    for value in items:
        if type(value) is not cls:
            return None
    if cls is int:
        scalar = _integer(items, tags)  # type: ignore[arg-type]
        return None if scalar is None else (scalar, items)
    return tags.classes[cls], [int(value) for value in items] if cls is Vocab64 else items  # type: ignore[arg-type]


def _integer(items: list[int], tags: Tags) -> Scalar | None:
    """Return the common type of plain integers: 32 bits, or 64 if each of them needs it; else None."""
    if min(items) >= INT32_MIN and max(items) <= INT32_MAX:
        return tags.int32
    return None if any(INT32_MIN <= value <= INT32_MAX for value in items) else tags.int64


def _first_word(value: Value) -> int:
    """Return the first four characters of an eight-character vocab, which is what YARP 3 uses."""
    number = int(value)  # type: ignore[arg-type]
    return int.from_bytes(number.to_bytes(8, "little", signed=True)[:4], "little", signed=True)
