"""Series of orientations, shape (n, 3, 3): how they turn, and which turn lies between two of them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot_testing.kinematics import rotation_vector

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray


def each_once(times: FloatArray) -> list[int]:
    """The places of those that differ, in their order; of equal ones the first, for what comes again turned nowhere."""
    places: list[int] = np.unique(times, return_index=True)[1].tolist()
    return places


def turns_of(rotations: FloatArray, times: FloatArray, window: int) -> FloatArray:
    """How fast a frame turns, in deg/s and in its own axes, as the mean over each ``window`` intervals; (n-window, 3).

    For windows in which it turns by a few degrees, where turns about different axes may be added; ``times`` (s)
    increase.
    """
    steps = zip(rotations[:-window], rotations[window:], strict=True)
    turned = np.degrees([rotation_vector(before.T @ after) for before, after in steps])
    rates: FloatArray = turned / (times[window:] - times[:-window])[:, None]
    return rates


def vertical_turn(found: FloatArray, wanted: FloatArray) -> float:
    """The turn about the vertical (rad) that brings one series nearest to the other: ``Rz(turn) found = wanted``."""
    between = np.einsum("nij,nkj->ik", wanted, found)
    return math.atan2(between[1, 0] - between[0, 1], between[0, 0] + between[1, 1])


def turn_between(found: FloatArray, wanted: FloatArray) -> FloatArray:
    """The rotation that brings vectors (n, 3) nearest to others: ``rotation @ found = wanted`` (Kabsch's way)."""
    left, _, right = np.linalg.svd(wanted.T @ found)
    handed = float(np.sign(np.linalg.det(left @ right)))
    rotation: FloatArray = left @ np.diag([1.0, 1.0, handed]) @ right
    return rotation
