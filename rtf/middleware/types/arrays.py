"""The codec of a plain numpy array that is given to a port: a vector or a matrix."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rtf.bottle import BottleTypeError
from rtf.middleware.types.matrix import MATRIX
from rtf.middleware.types.vector import vector_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.middleware.types.codecs import Codec

_VECTOR, _MATRIX = 1, 2


def codec_of_array(array: NDArray[Any]) -> Codec[Any]:
    """Return the codec of an array, by its dimensions and element type. Raises BottleTypeError with a hint."""
    if array.ndim == _VECTOR:
        return vector_of(array.dtype)
    if array.ndim == _MATRIX and array.dtype.kind in "if":
        return MATRIX
    raise BottleTypeError(
        f"an array of {array.dtype.name} of shape {array.shape} is neither a vector nor a matrix; "
        "if it is an image, wrap it in rtf.middleware.types.Image, else give a codec"
    )
