"""The type codes of values on the wire in the two dialects, and the packing of scalars of fixed size."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from rtf.bottle.errors import BottleSyntaxError
from rtf.bottle.values import Dialect, Float32, Int8, Int16, Int64, Kind, Vocab, Vocab64

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.bottle.containers import Value

LIST = 256
DICT = 512
GROUP = LIST | DICT
#: The largest number of values in a bottle: each costs up to sixty times its smallest size on the wire.
MAX_ELEMENTS = 1_000_000
_VOCABS_KEPT = 4096
_UNIT = {Dialect.YARP3: 255, Dialect.YARP4: 127}
_FLOATS = {Dialect.YARP3: (128, 10), Dialect.YARP4: (10, 20)}

int32 = struct.Struct("<i")
#: A code and what follows it: a small number, a length or a count.
pair = struct.Struct("<ii")


class TruncatedBottleError(BottleSyntaxError):
    """The bytes end before the bottle does; at least ``needed`` bytes are required, from the start of the data."""

    def __init__(self, needed: int) -> None:
        super().__init__(f"the bottle is truncated: at least {needed} bytes are needed")
        self.needed = needed


@dataclass(frozen=True, slots=True)
class Scalar:
    """A type of values of fixed size: its code, its letter in the struct module, and its constructor."""

    code: int
    letter: str
    make: Callable[[Any], Value] | None  # None: what is unpacked is the value
    one: struct.Struct
    with_code: struct.Struct
    size: int


def _scalar(code: int, letter: str, make: Callable[[Any], Value] | None) -> Scalar:
    one = struct.Struct(f"<{letter}")
    return Scalar(code, letter, make, one, struct.Struct(f"<i{letter}"), one.size)


class Tags:
    """The codes of one dialect: ``fixed`` are the types of fixed size by code, ``classes`` by the class of a value."""

    def __init__(self, dialect: Dialect) -> None:
        single, double = _FLOATS[dialect]
        self.float64_code = double
        self.unit = _UNIT[dialect]
        self.not_list = ~(GROUP | self.unit)
        self.int32 = _scalar(Kind.INT32.value, "i", None)
        self.int64 = _scalar(Kind.INT64.value, "q", Int64)
        self.classes: dict[type, Scalar] = {
            Int8: _scalar(Kind.INT8.value, "b", Int8),
            Int16: _scalar(Kind.INT16.value, "h", Int16),
            Int64: self.int64,
            Vocab: _scalar(Kind.VOCAB32.value, "i", vocabs.__getitem__),
            Float32: _scalar(single, "f", _single),
            float: _scalar(double, "d", None),
        }
        if dialect is Dialect.YARP4:
            self.classes[Vocab64] = _scalar(Kind.VOCAB64.value, "q", Vocab64)
        #: Classes whose values in a list may be encoded as a row of numbers.
        self.numbers = frozenset((int, *self.classes))
        self.fixed = {scalar.code: scalar for scalar in (self.int32, *self.classes.values())}
        self.sizes = {code: scalar.size for code, scalar in self.fixed.items()}
        #: The types of fixed size by the code of a list of them.
        self.lists = {LIST | code: scalar for code, scalar in self.fixed.items()}


@lru_cache(maxsize=256)  # bounded, as the counts of a peer may grow without end
def several(count: int, letter: str, front: str = "") -> struct.Struct:
    """Return the format of ``count`` numbers after a prefix. A look-up is faster than building the format string."""
    return struct.Struct(f"<{front}{count}{letter}")


def _single(value: float) -> Value:
    return float.__new__(Float32, value)  # it has single precision already


class _Vocabs(dict[int, Vocab]):
    """A cache of vocabs by number. The words of a robot's vocabulary are few, so their objects are kept."""

    def __missing__(self, value: int) -> Vocab:
        made = Vocab(value)
        if len(self) < _VOCABS_KEPT:
            self[value] = made
        return made


vocabs = _Vocabs()


TAGS = {dialect: Tags(dialect) for dialect in Dialect}
