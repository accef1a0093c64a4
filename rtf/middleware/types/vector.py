"""Vectors: one-dimensional numpy arrays, on the wire lists of numbers of one type."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.bottle import BottleError, BottleTypeError, Dialect, Float32, Int8, Int16, Int64, Vocab, as_float, as_int
from rtf.bottle.binary import TAGS, TruncatedBottleError, decode_from
from rtf.bottle.tags import LIST, pair
from rtf.middleware.types.codecs import TextCodec

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import TypeAlias

    from numpy.typing import ArrayLike, NDArray

    from rtf.bottle import Bottle
    from rtf.middleware.types.codecs import Buffer

    Array: TypeAlias = NDArray[Any]  # of the type of its codec's elements

#: Arrays up to this many bytes are copied behind the header, which is faster than a second block.
SMALL = 4096
_HEAD = pair.size
#: The bottle types of array element types; the code of a plain integer is 1 in both dialects.
_CLASSES = {"i1": Int8, "i2": Int16, "i8": Int64, "f4": Float32, "f8": float}


def _codes(dialect: Dialect) -> dict[str, int]:
    tags = TAGS[dialect]
    return {name: LIST | tags.classes[cls].code for name, cls in _CLASSES.items()} | {"i4": LIST | tags.int32.code}


#: The type code of the list, by dialect and element type.
CODES = {dialect: _codes(dialect) for dialect in Dialect}
_TYPES = {dialect: {code: np.dtype(f"<{name}") for name, code in codes.items()} for dialect, codes in CODES.items()}


class VectorCodec(TextCodec["Array"]):
    """Codec of arrays of one element type, such as ``f8`` for YARP's Vector, ``i4`` for its vector of integers.

    Anything that numpy converts to such an array without loss can be encoded. A received list may have numbers of any
    type, as a person types it; it becomes an array of the codec's type, which belongs to the receiver.
    """

    promise = "yarp/vector"

    def __init__(self, name: str) -> None:
        self.dtype = np.dtype(f"<{name}")
        self._codes = {dialect: codes[name] for dialect, codes in CODES.items()}

    def encode(self, value: ArrayLike, dialect: Dialect) -> Sequence[Buffer]:
        """Return a header and the memory of the array, joined if the array is small."""
        array = value
        if type(array) is not np.ndarray or array.dtype is not self.dtype or not array.flags.c_contiguous:
            array = contiguous(value, self.dtype)
        if array.ndim != 1:
            raise BottleTypeError(f"a vector has one dimension, not the shape {array.shape}")
        return with_head(pair.pack(self._codes[dialect], array.size), array)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[Array, int]:
        array, end = self.view_from(data, dialect)
        return array if array.flags.owndata else array.copy(), end

    def adopt(self, data: Buffer, dialect: Dialect) -> Array:
        """Decode a vector that is a view of the bytes."""
        return self.view_from(data, dialect)[0]

    def view_from(self, data: Buffer, dialect: Dialect, start: int = 0) -> tuple[Array, int]:
        """Decode the vector at ``start``; return it and its end offset.

        A vector of the codec's type is a view of the data.
        """
        if len(data) - start < _HEAD:
            raise TruncatedBottleError(start + _HEAD)
        code, count = pair.unpack_from(data, start)
        dtype = self.dtype if code == self._codes[dialect] else _TYPES[dialect].get(code)
        if dtype is None:
            bottle, end = decode_from(data, start, dialect)
            return self.from_bottle(bottle), end
        if count < 0:
            raise BottleError(f"a vector of {count} elements")
        end = start + _HEAD + count * dtype.itemsize
        if end > len(data):
            raise TruncatedBottleError(end)
        array = np.frombuffer(data, dtype, count, start + _HEAD)
        return array if dtype is self.dtype else fitting(array, self.dtype), end

    def from_bottle(self, bottle: Bottle) -> Array:
        """Convert a bottle of numbers, which may be of several types, to a vector. A vocab counts as its number."""
        for place, value in enumerate(bottle):
            if not isinstance(value, int | float | Vocab):
                raise BottleError(f"a vector holds numbers; element {place} is {str(value)[:40]!r}")
        number = as_float if any(isinstance(value, float) for value in bottle) else as_int
        return fitting(np.array([number(value) for value in bottle]), self.dtype)


def with_head(head: bytes, array: Array) -> Sequence[Buffer]:
    """Return the blocks of a header and the contiguous array behind it."""
    return (head + array.tobytes(),) if array.nbytes <= SMALL else (head, array.data.cast("B"))


def contiguous(value: ArrayLike, dtype: np.dtype[Any]) -> Array:
    """Return a contiguous array of the type; the value itself if it is one. Raises BottleTypeError."""
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise BottleTypeError(f"{str(value)[:40]!r} cannot be converted to an array: {error}") from None
    return np.ascontiguousarray(fitting(array, dtype))


def fitting(array: Array, dtype: np.dtype[Any]) -> Array:
    """Convert an array to the type; returns itself if it has it. Raises BottleTypeError for a value out of range."""
    if array.dtype == dtype:
        return array
    if array.size and array.dtype.kind not in "iuf":
        raise BottleTypeError(f"an array of {array.dtype} holds no numbers")
    if dtype.kind == "f":
        with np.errstate(over="ignore"):  # a value out of the range of a float type becomes infinite
            return array.astype(dtype)
    info = np.iinfo(dtype)
    # The power of two above the greatest integer is exact in floating point; the integer itself often is not.
    below = array < -float(info.min) if array.dtype.kind == "f" else array <= info.max
    if not (below & (array >= info.min)).all():
        raise BottleTypeError(f"an element does not fit into {dtype.name}, or is not a number")
    made = array.astype(dtype)
    if array.dtype.kind == "f" and (made != array).any():
        raise BottleTypeError(f"an element is not a whole number, as {dtype.name} requires")
    return made


_VECTORS = {codec.dtype: codec for codec in map(VectorCodec, (*_CLASSES, "i4"))}
VECTOR = _VECTORS[np.dtype("<f8")]


def vector_of(dtype: str | type | np.dtype[Any]) -> VectorCodec:
    """Return the codec of vectors of a numpy type, such as ``np.int32`` or ``"f4"``. Raises BottleTypeError."""
    wanted = dtype if isinstance(dtype, np.dtype) else np.dtype(dtype)
    codec = _VECTORS.get(wanted) or _VECTORS.get(wanted.newbyteorder("<"))
    if codec is None:
        names = ", ".join(known.name for known in _VECTORS)
        raise BottleTypeError(f"there are no vectors of {wanted.name}; convert it with astype to one of {names}")
    return codec
