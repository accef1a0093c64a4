"""The force with which an accelerated limb loads its force-torque sensor, from joint speeds that may be noisy.

Noise of the speeds looks like acceleration: 1 deg/s of it in each joint of a leg would explain 30 N. So the
acceleration is the slope of a line through several states, the steepest of any 0.04 s, less the slope that the noise of
a limb at rest shows. A line through the whole time that may have led to a force would be too flat for a step, which
accelerates and brakes within it.
"""

from __future__ import annotations

import statistics
from bisect import bisect_left
from collections import deque
from itertools import accumulate, pairwise, repeat
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray

_GRAVITY = 9.81
#: A line goes through the states of this time, s: four of them at a period of 10 ms, whose stamps may jitter.
_LINE = 0.035
#: Least time between two stamps, s.
_SHORTEST = 1e-3
#: A joint that moves less during the line is at rest, deg: more than the jitter of encoders.
_STILL = 0.2
#: Evaluations at rest before a limb counts as settled, further ones before its noise is known, and those kept of them.
_SETTLED, _ENOUGH, _KEPT = 5, 10, 50


class Load(NamedTuple):
    """The load of a sensor: its weight (N), and about the greatest distance of its centre of mass from a joint (m)."""

    weight: float
    lever: float


class InertialForce:
    """The greatest inertial force of a load (N), evaluated periodically; for one thread."""

    def __init__(self, load: Load) -> None:
        self._inertia = load.weight / _GRAVITY * load.lever  # N by rad/s²
        self._still = 0  # evaluations in a row at rest
        self._resting: deque[float] = deque(maxlen=_KEPT)  # forces that noise simulated at rest, N

    def bound(self, times: Sequence[float], positions: FloatArray, speeds: FloatArray) -> float:
        """Return the greatest inertial force (N) that states explain; NaN if one of them is not finite.

        ``times`` are in s, ``positions`` in rad and ``speeds`` in rad/s, of shape (states, joints).
        """
        if not (np.isfinite(positions).all() and np.isfinite(speeds).all()):
            return np.nan
        accelerated = self._inertia * _steepest(times, speeds)
        self._still = self._still + 1 if np.abs(positions[-1] - positions[0]).max() < np.radians(_STILL) else 0
        if self._still > _SETTLED:
            self._resting.append(accelerated)
        centrifugal = self._inertia * float((np.abs(speeds).sum(axis=1) ** 2).max())
        return max(0.0, accelerated - self.noise) + centrifugal

    @property
    def noise(self) -> float:
        """The force that noise of the speeds simulates at rest, N; 0 before it is known."""
        return statistics.median(self._resting) if len(self._resting) >= _ENOUGH else 0.0


def _steepest(times: Sequence[float], speeds: FloatArray) -> float:
    """Return the greatest sum of all joints' accelerations (rad/s²), by lines through the states of a short time."""
    passed = [*accumulate((max(after - before, _SHORTEST) for before, after in pairwise(times)), initial=0.0)]
    lines, last = [], 0
    for begin in range(len(times) - 1):
        end = max(bisect_left(times, times[begin] + _LINE), begin + 2)
        if end > last:  # after the last line that is long enough they only get shorter
            lines.append(_line(passed, begin, end))
            last = end
    slopes = np.array(lines) @ speeds
    return float(np.abs(slopes).sum(axis=1).max())


def _line(times: Sequence[float], begin: int, end: int) -> list[float]:
    """Return the shares of all states in the slope of a line through those from ``begin`` to before ``end``."""
    mean = sum(times[begin:end]) / (end - begin)
    away = [time - mean for time in times[begin:end]]
    square = sum(one * one for one in away)
    return [*repeat(0.0, begin), *(one / square for one in away), *repeat(0.0, len(times) - end)]
