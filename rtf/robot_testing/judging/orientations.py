"""Series of orientations, shape (n, 3, 3): their angular velocities, and the rotation between two series."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot_testing.judging.kinematics import rotation_vector
from rtf.robot_testing.judging.statistics import CONFIDENCE, student

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray


def each_once(times: FloatArray) -> list[int]:
    """Return the indices of the distinct times in increasing order, the first of equal ones."""
    places: list[int] = np.unique(times, return_index=True)[1].tolist()
    return places


def turns_of(rotations: FloatArray, times: FloatArray, window: int) -> FloatArray:
    """Return the angular velocity of a frame, in deg/s about its own axes, as means over ``window`` intervals.

    The shape is (n - window, 3); ``times`` (s) increase. Valid for rotations of a few degrees within a window, where
    rotations about different axes may be added.
    """
    steps = zip(rotations[:-window], rotations[window:], strict=True)
    turned = np.degrees([rotation_vector(before.T @ after) for before, after in steps])
    rates: FloatArray = turned / (times[window:] - times[:-window])[:, None]
    return rates


def vertical_turn(found: FloatArray, wanted: FloatArray) -> float:
    """Return the yaw (rad) that brings one series nearest to the other: ``Rz(yaw) found = wanted``."""
    between = np.einsum("nij,nkj->ik", wanted, found)
    return math.atan2(between[1, 0] - between[0, 1], between[0, 0] + between[1, 1])


def turn_between(found: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return the rotation that brings vectors (n, 3) nearest to others: ``rotation @ found = wanted`` (Kabsch)."""
    left, _, right = np.linalg.svd(wanted.T @ found)
    handed = float(np.sign(np.linalg.det(left @ right)))
    rotation: FloatArray = left @ np.diag([1.0, 1.0, handed]) @ right
    return rotation


class Turn(NamedTuple):
    """A rotation by ``angle`` (deg) about a unit ``axis``, with half the width of its confidence interval (deg).

    The interval is that about the least certain axis; infinite if the data do not determine the rotation about it.
    """

    angle: float
    axis: FloatArray
    interval: float


def sure_turn(found: FloatArray, wanted: FloatArray, level: float = CONFIDENCE) -> Turn:
    """Return the rotation that brings independent vectors (n, 3) nearest to others, with its confidence interval.

    Each vector contributes by its error perpendicular to itself; the variances of these need not be equal (the
    "sandwich" covariance of White, Econometrica 48, 1980).
    """
    rotation = turn_between(found, wanted)
    vector = np.degrees(rotation_vector(rotation))
    angle, turned = float(np.linalg.norm(vector)), found @ rotation.T
    both, freedom = wanted.T @ turned, len(found) - 3
    stiffness = np.trace(both) * np.eye(3) - (both + both.T) / 2
    interval = math.inf
    if freedom > 0 and np.linalg.eigvalsh(stiffness)[0] > _UNKNOWN * np.trace(stiffness):
        pulls = np.linalg.solve(stiffness, np.cross(turned, wanted).T)
        interval = student(level, freedom) * math.degrees(float(np.linalg.norm(pulls, 2)))
    return Turn(angle, vector / max(angle, _TINY), interval)


#: Least share of the stiffness about an axis with which the vectors determine it; and the least divisor.
_UNKNOWN, _TINY = 1e-6, 1e-9
