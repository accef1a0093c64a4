"""The optics of a camera: its projection and its pose, and how YARP names them in both dialects."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rtf.bottle import BottleError, Dialect, Property
from rtf.bottle.binary import encode
from rtf.middleware.types import MATRIX
from rtf.robot.errors import NoAnswerError
from rtf.robot.interfaces import Intrinsics

if TYPE_CHECKING:
    from rtf.bottle import Bottle
    from rtf.robot.interfaces import FloatArray

_ROWS = 4  # of the matrix of the extrinsics
#: The names of the parameters of a projection, in the order of Intrinsics.
_NAMES = ("focalLengthX", "focalLengthY", "principalPointX", "principalPointY")
_DISTORTION = ("k1", "k2", "t1", "t2", "k3")


def pinhole(size: tuple[int, int], field_of_view: tuple[float, float]) -> Intrinsics:
    """Return the projection of a camera without distortion, by its size in pixels and its field of view in deg."""
    (width, height), (horizontal, vertical) = size, field_of_view
    return Intrinsics(
        width / 2 / math.tan(math.radians(horizontal) / 2),
        height / 2 / math.tan(math.radians(vertical) / 2),
        (width - 1) / 2,
        (height - 1) / 2,
    )


def property_of(intrinsics: Intrinsics) -> Property:
    """Return the parameters of a projection as YARP names them, in both dialects."""
    *projection, distortion = intrinsics
    return Property(
        {
            "physFocalLength": 0.0,
            **dict(zip(_NAMES, map(float, projection), strict=True)),
            "distortionModel": "plumb_bob",
            **dict(zip(_DISTORTION, map(float, distortion), strict=True)),
        }
    )


def intrinsics_of(found: Property) -> Intrinsics:
    """Return the parameters of a projection by their names. Raises BottleError if one is missing or no number."""
    names = (*_NAMES, *_DISTORTION)
    values = [found.get(name, 0.0 if name in _DISTORTION else None) for name in names]
    wrong = [name for name, value in zip(names, values, strict=True) if not isinstance(value, int | float)]
    if wrong:
        raise BottleError(f"the parameters {found.to_text()[:60]!r} of a camera have no number {', '.join(wrong)}")
    fx, fy, cx, cy, *distortion = (float(value) for value in values if isinstance(value, int | float))
    k1, k2, t1, t2, k3 = distortion
    return Intrinsics(fx, fy, cx, cy, (k1, k2, t1, t2, k3))


def matrix_of(found: Bottle, name: str) -> FloatArray:
    """Return a 4 x 4 matrix from its elements. Raises NoAnswerError."""
    try:
        matrix = np.asarray(MATRIX.decode(encode(found, Dialect.YARP4), Dialect.YARP4), dtype=np.float64)
    except BottleError as error:
        raise NoAnswerError(f"{name}: {error}") from error
    if matrix.shape != (_ROWS, _ROWS):
        raise NoAnswerError(f"{name}: the pose of a camera is a 4 x 4 matrix, not one of {matrix.shape}")
    return matrix
