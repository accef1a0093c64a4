"""Poses: matrices, vectors of a position with an axis and an angle, and how far two of them are apart.

A matrix is homogeneous, 4 by 4, in metres. A vector has seven numbers, as on the wire: x, y, z (m), the axis of the
rotation, and its angle (rad), which is between 0 and pi.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.errors import RefusedError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

POSITION, POSE = 3, 7  # numbers of a vector
#: Twice the sine of an angle below which the axis is that of no rotation, or of half a turn.
_SMALL = 1e-9
#: How far a matrix may be from a rotation, as rounded to six digits.
_ROUNDED = 1e-5


def rotation_of(axis: ArrayLike, angle: float) -> NDArray[np.float64]:
    """Return the rotation (3, 3) about an axis of any length by an angle (rad).

    An axis of no length is that of no rotation. Raises RefusedError for one with an angle, and for what is no number.
    """
    vector = np.asarray(axis, dtype=np.float64)
    if vector.shape != (3,) or not np.isfinite(vector).all() or not math.isfinite(angle):
        raise RefusedError(f"expected an axis of three numbers and an angle, not {axis!r} and {angle}")
    length = float(np.linalg.norm(vector))
    if length == 0.0:
        if angle != 0.0:
            raise RefusedError(f"a rotation by {angle:g} rad has an axis, not (0 0 0)")
        return np.eye(3)
    cross = skew(vector / length)
    rotation: NDArray[np.float64] = np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross
    return rotation


def axis_angle_of(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return axis and angle (rad, 0 to pi) of a rotation (3, 3), as four numbers.

    The axis of no rotation is (0 0 1). Of half a turn, the sign of the axis is arbitrary.
    """
    vector = _twice_sine(rotation)
    length = float(np.linalg.norm(vector))
    cosine = (float(np.trace(rotation)) - 1.0) / 2.0
    angle = math.atan2(length / 2.0, cosine)
    if length >= _SMALL:
        return np.append(vector / length, angle)
    if cosine > 0.0:
        return np.array([0.0, 0.0, 1.0, 0.0])
    squares = (rotation + np.eye(3)) / 2.0  # of half a turn: the products of the numbers of the axis
    column: NDArray[np.float64] = squares[:, int(np.argmax(np.diag(squares)))]
    return np.append(column / np.linalg.norm(column), angle)


def pose_of(vector: ArrayLike) -> NDArray[np.float64]:
    """Return the matrix of a vector of seven numbers. The axis may have any length but 0.

    Raises RefusedError for other counts, numbers that are none, and an axis of no length with an angle.
    """
    values = np.asarray(vector, dtype=np.float64)
    if values.shape != (POSE,) or not np.isfinite(values).all():
        raise RefusedError(f"a pose is x, y, z, the axis and the angle of its rotation, seven numbers, not {vector!r}")
    return homogeneous(rotation_of(values[3:6], float(values[6])), values[:3])


def vector_of(pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the vector of seven numbers of a matrix."""
    return np.concatenate([pose[:3, 3], axis_angle_of(pose[:3, :3])])


def homogeneous(rotation: ArrayLike, translation: ArrayLike = (0.0, 0.0, 0.0)) -> NDArray[np.float64]:
    """Return the matrix with this rotation (3, 3) and translation (m)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    return matrix


def checked_pose(pose: ArrayLike) -> NDArray[np.float64]:
    """Return a matrix, its rotation made exact. Raises RefusedError for what is no pose."""
    matrix = np.asarray(pose, dtype=np.float64)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise RefusedError(f"a pose is a matrix of 4 by 4 numbers, not {pose!r}")
    rotation = matrix[:3, :3]
    left, sizes, right = np.linalg.svd(rotation)
    if not np.allclose(sizes, 1.0, atol=_ROUNDED) or np.linalg.det(rotation) < 0.0 or (matrix[3] != (0, 0, 0, 1)).any():
        raise RefusedError(
            f"the first three rows of a pose are a rotation and a translation, the last is 0 0 0 1: {pose!r}"
        )
    return homogeneous(left @ right, matrix[:3, 3])


def pose_error(wanted: NDArray[np.float64], pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what is left from a pose to another: a translation (m), and a rotation vector (rad), in root axes."""
    turn = axis_angle_of(wanted[:3, :3] @ pose[:3, :3].T)
    return np.concatenate([wanted[:3, 3] - pose[:3, 3], turn[:3] * turn[3]])


def skew(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the matrix whose product with another vector is the cross product."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _twice_sine(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
