"""Records: the lists by which generated services encode calls and answers.

Unlike bottles, such lists are never specialised: each element has its type code. Structures have no brackets: as an
argument, as a return value and inside each other, their fields are consecutive elements. The elements of a record, by
their Python type:

    bool                             [ok] or [fail]
    int, Int8, Int16, Int64          integers of 32, 8, 16, 64 bits
    float, str, bytes                a double, a string, a blob
    Vocab, Bottle                    as they are
    tuple                            a structure: its fields
    list                             a list: of scalars, or of tuples, each a list of its fields
    dict                             a map: a list of lists of key and value
    Property, array, Image, Pair …   one element, as the codec writes it
    Record                           one element, a record again
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from rtf.bottle import Bottle, Dialect, Vocab, coerce
from rtf.bottle.binary import LIST, TAGS, decode_from, encode, encode_element
from rtf.bottle.tags import pair
from rtf.bottle.values import Kind, utf8
from rtf.middleware.types.codecs import TextCodec, codec_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from rtf.middleware.types.codecs import Buffer

OK, FAILED = Vocab("ok"), Vocab("fail")
#: A record of at most this many bytes is sent in one piece.
_COPIED = 64 << 10
_SCALARS = (int, float, str, bytes, Vocab)
_WORDS = (str, Vocab)
_SHORT = 4
_STRING, _INT32 = Kind.STRING.value, Kind.INT32.value
_INT32_MAX = 2**31 - 1
_pack_double, _pack_int = struct.Struct("<id").pack, struct.Struct("<ii").pack


class RecordCodec(TextCodec["Record"]):
    """Codec of records. A received record has the elements of the bottle: only the service knows the structure."""

    def encode(self, value: Record, dialect: Dialect) -> Sequence[Buffer]:
        """Return one block, or several if there are large arrays."""
        blocks: list[Buffer] = [b""]
        blocks[0] = pair.pack(LIST, _put_all(value.fields, blocks, dialect))
        return (b"".join(blocks),) if sum(map(len, blocks)) <= _COPIED else blocks

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[Record, int]:
        bottle, end = decode_from(data, 0, dialect)
        return Record(*bottle), end


@dataclass(init=False, slots=True)
class Record:
    """A list that is not specialised. The module docstring lists the types of its values."""

    fields: tuple[object, ...]
    codec: ClassVar[RecordCodec] = RecordCodec()

    def __init__(self, *fields: object) -> None:
        self.fields = fields


def _put_all(values: Iterable[object], blocks: list[Buffer], dialect: Dialect) -> int:
    code, count = TAGS[dialect].float64_code, 0
    for value in values:
        if type(value) is float:  # the most frequent types, and worth the lines
            blocks.append(_pack_double(code, value))
            count += 1
        elif type(value) is str:
            text = utf8(value)
            blocks += pair.pack(_STRING, len(text)), text
            count += 1
        elif type(value) is int and -_INT32_MAX <= value <= _INT32_MAX:
            blocks.append(_pack_int(_INT32, value))
            count += 1
        else:
            count += _put(value, blocks, dialect)
    return count


def _put(value: object, blocks: list[Buffer], dialect: Dialect) -> int:
    """Encode a value. Return the number of elements that it takes."""
    if isinstance(value, tuple):
        return _put_all(value, blocks, dialect)
    if isinstance(value, bool):
        blocks.append(encode_element(OK if value else FAILED, dialect))
    elif isinstance(value, dict):
        _put_lists([*value.items()], blocks, dialect)
    elif isinstance(value, list):
        _put_list(value, blocks, dialect)
    elif isinstance(value, _SCALARS):
        blocks.append(encode_element(coerce(value), dialect))
    else:
        blocks += codec_of(value).encode(value, dialect)
    return 1


def _put_list(values: list[object], blocks: list[Buffer], dialect: Dialect) -> None:
    if all(isinstance(value, _SCALARS) for value in values):
        scalars = [(OK if value else FAILED) if isinstance(value, bool) else value for value in values]
        blocks.append(encode(Bottle(scalars), dialect))
    else:
        _put_lists(values, blocks, dialect)


def _put_lists(values: Sequence[object], blocks: list[Buffer], dialect: Dialect) -> None:
    """Encode a list of structures, each as a list, or of other values that are encoded as lists."""
    blocks.append(pair.pack(LIST, len(values)))
    for value in values:
        _put(Record(*value) if isinstance(value, tuple) else value, blocks, dialect)


def call(function: str, *arguments: object) -> Record:
    """Return the call of a function: ``call("get_phase")``. Words of up to four letters are vocabs, others strings."""
    words = [Vocab(word) if 0 < len(word.encode()) <= _SHORT else word for word in function.split("_")]
    return Record(*words, *arguments)


def read_call(request: Bottle, functions: Iterable[str]) -> tuple[str, Bottle] | None:
    """Return the called function and its arguments; None if it is none of ``functions``.

    The words of the name may be vocabs or strings, and one string may hold several. The longest matching name is
    chosen.
    """
    return FunctionNames(functions).read(request)


class FunctionNames:
    """The names of functions, for :func:`read_call` of many requests."""

    def __init__(self, functions: Iterable[str]) -> None:
        self._known = frozenset(functions)
        self._most = 1 + max((name.count("_") for name in self._known), default=0)
        longer = {name.rpartition("_")[0] for name in self._known}
        #: Those of one word that begin no other one, by this word: most calls are found at once.
        self._alone: dict[object, str] = {}
        for name in self._known:
            if "_" not in name and not any(other == name or other.startswith(f"{name}_") for other in longer):
                self._alone |= dict.fromkeys((name, *call(name).fields), name)

    def read(self, request: Bottle) -> tuple[str, Bottle] | None:
        """Return the called function and its arguments, as :func:`read_call`."""
        elements = request.elements()
        if elements and type(elements[0]) in _WORDS and (alone := self._alone.get(elements[0])) is not None:
            return alone, request[1:]
        name, found = "", 0
        called = ""
        for place, value in enumerate(elements[: self._most], 1):
            if not isinstance(value, (str, Vocab)):
                break
            name = f"{name}_{value}" if name else str(value)
            if name in self._known:
                called, found = name, place
        return (called, request[found:]) if found else None
