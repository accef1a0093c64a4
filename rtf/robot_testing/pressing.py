"""What a limb presses on its force-torque sensor with while it is hastened and swung, by speeds that may be noisy.

Speeds that differ by noise from one state to the next would explain forces that nobody has: 1 deg/s of it in each joint
of a leg, 30 N. So the acceleration is that of a line through several states, the steepest of any 0.04 s, and what that
shows of a limb at rest is taken off. A line through the whole time that may have led to a force would be too flat: the
simulated leg, stepped by 4 deg, presses with 19 N more than such a line explains, and with 0 N more than this one does.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray

_GRAVITY = 9.81
#: States of so long a time make a line, s; in periods of 10 ms four of them, whose stamps may be a little apart.
_LINE = 0.035
#: Two stamps are taken to be so far apart at least, s.
_SHORTEST = 1e-3
#: A joint that goes no further meanwhile is at rest, deg: more than encoders jitter.
_STILL = 0.2
#: So many looks at rest it takes to have come to rest, so many more tell its noise, and so many of them are kept.
_SETTLED, _ENOUGH, _KEPT = 5, 10, 50


class Load(NamedTuple):
    """What hangs beyond a sensor: its weight (N), and how far from a joint its middle is at most, about (m)."""

    weight: float
    lever: float


class Pressing:
    """What a load may press with, N, look by look; from one thread."""

    def __init__(self, load: Load) -> None:
        self._inertia = load.weight / _GRAVITY * load.lever  # N by rad/s²
        self._still = 0  # looks in a row at a limb at rest
        self._resting: deque[float] = deque(maxlen=_KEPT)  # what noise seemed to press with at rest, N

    def most(self, times: FloatArray, positions: FloatArray, speeds: FloatArray) -> float:
        """The most that it may press with by these states: s, rad and rad/s, a row a state and a column a joint.

        NaN where one of them is no number.
        """
        if not (np.isfinite(positions).all() and np.isfinite(speeds).all()):
            return np.nan
        hastened = self._inertia * _steepest(times, speeds)
        self._still = self._still + 1 if np.abs(positions[-1] - positions[0]).max() < np.radians(_STILL) else 0
        if self._still > _SETTLED:
            self._resting.append(hastened)
        swung = self._inertia * float((np.abs(speeds).sum(axis=1) ** 2).max())
        return max(0.0, hastened - self.noise) + swung

    @property
    def noise(self) -> float:
        """What it seems to press with at rest, N; 0 before that is known."""
        return float(np.median(self._resting)) if len(self._resting) >= _ENOUGH else 0.0


def _steepest(times: FloatArray, speeds: FloatArray) -> float:
    """The greatest sum of all joints' accelerations (rad/s²), by lines through all states of a short time."""
    ends = np.maximum(np.searchsorted(times, times + _LINE), np.arange(len(times)) + 2)
    # Behind the last line that is long enough they only get shorter.
    begins = [begin for begin in range(len(times) - 1) if not begin or ends[begin] > ends[begin - 1]]
    return max(_slope(times[begin : ends[begin]], speeds[begin : ends[begin]]) for begin in begins)


def _slope(times: FloatArray, speeds: FloatArray) -> float:
    apart = np.maximum(np.diff(times), _SHORTEST).cumsum()
    away = np.concatenate(([0.0], apart)) - apart.sum() / len(times)
    return float(np.abs(away @ speeds).sum() / (away @ away))
