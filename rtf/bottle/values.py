"""The scalar values of a bottle: Python's own types, and small classes for further types of the wire format.

``int`` is I32 when it fits and I64 otherwise, ``float`` is F64, ``str`` is STR and ``bytes`` is BLOB. The classes here
are the types that these cannot distinguish. Strings are sent as UTF-8; bytes that are not UTF-8 become lone surrogates
(``surrogateescape``), so no information is lost.
"""

from __future__ import annotations

import enum
import struct
from typing import ClassVar, Self

from rtf.bottle.errors import BottleError

INT32_MIN, INT32_MAX = -(2**31), 2**31 - 1
INT64_MIN, INT64_MAX = -(2**63), 2**63 - 1

_SINGLE = struct.Struct("<f")


class Kind(enum.IntEnum):
    """The types of values, numbered as YARP 3.x tags them on the wire (4.0 tags floats differently)."""

    INT32 = 1
    STRING = 4
    VOCAB32 = 9
    FLOAT64 = 10
    BLOB = 12
    INT64 = 17
    VOCAB64 = 18  # YARP 4.0 only
    INT8 = 32
    INT16 = 64
    FLOAT32 = 128
    LIST = 256
    DICT = 768


class Dialect(enum.IntEnum):
    """The major version of YARP's protocol. Messages do not contain it, so it is configured; 3 is the default."""

    YARP3 = 3
    YARP4 = 4


def utf8(text: str) -> bytes:
    """Encode text for the wire. Raises :class:`BottleError` for a surrogate that does not represent a byte."""
    try:
        return text.encode("utf-8", "surrogateescape")
    except UnicodeEncodeError as error:
        raise BottleError(f"{text[error.start]!r} cannot be written as UTF-8", error.start) from None


def to_single(value: float) -> float:
    """Round to single precision; a value out of range becomes infinite, as in a C cast."""
    try:
        return float(_SINGLE.unpack(_SINGLE.pack(value))[0])
    except OverflowError:
        return float("inf") if value > 0 else float("-inf")


class _SizedInt(int):
    """An integer whose type on the wire does not depend on its magnitude."""

    __slots__ = ()
    BITS: ClassVar[int]

    def __new__(cls, value: int = 0) -> Self:
        if not -(1 << cls.BITS - 1) <= value < 1 << cls.BITS - 1:
            raise BottleError(f"{value} does not fit into {cls.BITS} bits; use a wider integer")
        return super().__new__(cls, value)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({int(self)})"

    def __str__(self) -> str:
        return int.__repr__(self)


class Int8(_SizedInt):
    """An 8-bit integer (I8); a number outside -128…127 raises :class:`BottleError`."""

    __slots__ = ()
    BITS = 8


class Int16(_SizedInt):
    """A 16-bit integer (I16); a number outside its range raises :class:`BottleError`."""

    __slots__ = ()
    BITS = 16


class Int64(_SizedInt):
    """A 64-bit integer (I64) even when it is small; a plain ``int`` is one only when it does not fit into 32 bits."""

    __slots__ = ()
    BITS = 64


class Float32(float):
    """A single-precision number (F32): rounded when it is made, infinite when it is too large."""

    __slots__ = ()

    def __new__(cls, value: float = 0.0) -> Self:
        """Round to single precision."""
        return super().__new__(cls, to_single(value))

    def __repr__(self) -> str:
        return f"Float32({float(self)!r})"

    def __str__(self) -> str:
        return float.__repr__(self)


class Vocab:
    """A word of up to four bytes packed into a 32-bit integer, first byte lowest (V32).

    ``Vocab("set")`` packs text, ``Vocab(7628147)`` takes the number (signed or unsigned). Text that is longer than
    the word raises :class:`BottleError`. There is no boolean on the wire: :data:`TRUE` is the vocab ``'1'`` and
    :data:`FALSE` is 0. A vocab equals only a vocab of its own width, never a string or a number.
    """

    __slots__ = ("_value",)
    WIDTH: ClassVar[int] = 4

    def __init__(self, value: int | str = 0) -> None:
        if isinstance(value, str):
            packed = utf8(value)
            if len(packed) > self.WIDTH:
                raise BottleError(f"the vocab {value!r} is longer than {self.WIDTH} bytes")
            self._value = int.from_bytes(packed.ljust(self.WIDTH, b"\0"), "little", signed=True)
        else:
            bits = 8 * self.WIDTH
            if not -(1 << bits - 1) <= value < 1 << bits:
                raise BottleError(f"{value} does not fit into a vocab of {bits} bits")
            self._value = value - (1 << bits) if value >= 1 << bits - 1 else int(value)

    @classmethod
    def truncated(cls, text: str) -> Self:
        """Pack the first bytes of ``text`` and ignore the rest, as YARP's parser does."""
        return cls(int.from_bytes(utf8(text)[: cls.WIDTH], "little"))

    @property
    def value(self) -> int:
        """The packed number, signed."""
        return self._value

    @property
    def text(self) -> str:
        """The characters up to the first NUL; the empty string for 0."""
        packed = self._value.to_bytes(self.WIDTH, "little", signed=True)
        return packed.split(b"\0", 1)[0].decode("utf-8", "surrogateescape")

    def __int__(self) -> int:
        return self._value

    def __bool__(self) -> bool:
        return self._value != 0

    def __eq__(self, other: object) -> bool:
        if isinstance(other, Vocab):
            return self._value == other._value and self.WIDTH == other.WIDTH
        return NotImplemented

    def __hash__(self) -> int:
        return hash((self.WIDTH, self._value))

    def __str__(self) -> str:
        """Return the word as YARP prints it outside a bottle: ``true``, ``false`` or the characters."""
        if self._value in _BOOLEANS:
            return _BOOLEANS[self._value]
        return self.text

    def __repr__(self) -> str:
        text = self.text
        exact = text and int.from_bytes(utf8(text), "little") == self._value & ((1 << 8 * self.WIDTH) - 1)
        return f"{type(self).__name__}({text!r})" if exact else f"{type(self).__name__}({self._value})"

    def __reduce__(self) -> tuple[type[Self], tuple[int]]:
        return type(self), (self._value,)


class Vocab64(Vocab):
    """A word of up to eight bytes (V64), which only YARP 4.0 supports."""

    __slots__ = ()
    WIDTH = 8


_BOOLEANS = {0: "false", ord("1"): "true"}
TRUE = Vocab("1")
FALSE = Vocab(0)
