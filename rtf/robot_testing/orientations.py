"""Series of orientations, shape (n, 3, 3): how they turn, and which turn lies between two of them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot_testing.kinematics import rotation_vector
from rtf.robot_testing.statistics import CONFIDENCE, student

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


class Turn(NamedTuple):
    """A turn by ``angle`` (deg) about an axis of length 1, and half the width of its interval (deg).

    The interval is that about the axis about which least is known; infinite where nothing is.
    """

    angle: float
    axis: FloatArray
    interval: float


def sure_turn(found: FloatArray, wanted: FloatArray, level: float = CONFIDENCE) -> Turn:
    """The turn that brings independent vectors (n, 3) nearest to others, and how sure it is.

    Each vector pulls at the turn by its error across itself; these need not be alike ("sandwich" of the covariance,
    White, Econometrica 48, 1980).
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


#: Of what vectors hold a turn by, the share about an axis from which on it is held; and what is not divided by.
_UNKNOWN, _TINY = 1e-6, 1e-9
