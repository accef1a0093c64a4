"""Matrices: two-dimensional numpy arrays of doubles, on the wire the rows, the columns and a list of elements."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.bottle import Bottle, BottleError, BottleTypeError, Dialect
from rtf.bottle.binary import LIST, decode_from
from rtf.bottle.tags import pair
from rtf.bottle.values import INT32_MAX, Kind
from rtf.middleware.types.codecs import TextCodec
from rtf.middleware.types.vector import CODES, VECTOR, contiguous, vector_of, with_head

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from rtf.middleware.types.codecs import Buffer, Codec
    from rtf.middleware.types.vector import Array

_DOUBLE = np.dtype("<f8")
_HEAD = struct.Struct("<8i")
_INT32 = Kind.INT32.value
_PARTS = 3


class MatrixCodec(TextCodec["Array"]):
    """Codec of matrices. A received matrix may have numbers of any type, as a person types it: ``2 2 (1 2 3 4)``."""

    promise = "yarp/matrix"

    def encode(self, value: ArrayLike, dialect: Dialect) -> Sequence[Buffer]:
        """Return a header and the memory of the array, joined if the array is small."""
        array = contiguous(value, _DOUBLE)
        if array.ndim != 2:  # noqa: PLR2004 - rows and columns
            raise BottleTypeError(f"a matrix has two dimensions, not the shape {array.shape}")
        if array.size > INT32_MAX:
            raise BottleTypeError(f"a matrix of {array.size} elements is too large for a message")
        rows, columns = array.shape
        return with_head(
            _HEAD.pack(LIST, _PARTS, _INT32, rows, _INT32, columns, CODES[dialect]["f8"], array.size), array
        )

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[Array, int]:
        array, end = self._view(data, dialect)
        return array.copy(), end

    def adopt(self, data: Buffer, dialect: Dialect) -> Array:
        """Decode a matrix that is a view of the bytes."""
        return self._view(data, dialect)[0]

    def _view(self, data: Buffer, dialect: Dialect) -> tuple[Array, int]:
        if len(data) >= _HEAD.size:
            kind, parts, first, rows, second, columns, _, _ = _HEAD.unpack_from(data)
            if (kind, parts, first, second) == (LIST, _PARTS, _INT32, _INT32):
                elements, end = VECTOR.view_from(data, dialect, _HEAD.size - pair.size)
                return _shaped(elements, rows, columns), end
        bottle, end = decode_from(data, 0, dialect)
        rows, columns, numbers = bottle if len(bottle) == _PARTS else (None, None, None)
        if not (isinstance(rows, int) and isinstance(columns, int) and isinstance(numbers, Bottle)):
            raise BottleError(f"a matrix is rows, columns and a list, not {bottle.to_text()[:60]!r}")
        return _shaped(VECTOR.from_bottle(numbers), rows, columns), end


def _shaped(elements: Array, rows: int, columns: int) -> Array:
    if rows < 0 or columns < 0 or rows * columns != elements.size:
        raise BottleError(f"a matrix of {rows} rows and {columns} columns with {elements.size} elements")
    return elements.reshape(rows, columns)


MATRIX = MatrixCodec()


def codec_of_array(array: Array) -> Codec[Any]:
    """Return the codec of an array, by its dimensions and element type. Raises BottleTypeError with a hint."""
    if array.ndim == 1:
        return vector_of(array.dtype)
    if array.ndim == 2 and array.dtype.kind in "if":  # noqa: PLR2004 - rows and columns
        return MATRIX
    raise BottleTypeError(
        f"an array of {array.dtype.name} of shape {array.shape} is neither a vector nor a matrix; "
        "if it is an image, wrap it in rtf.middleware.types.Image, else give a codec"
    )
