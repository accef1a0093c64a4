"""Speeds that lead to a target almost with minimum jerk, also when the target moves.

The filter makes a speed of the way that is left. Where the speed is integrated and fed back, a step is done to 90 % in
the given time and to the end in half as long again, with a bell of a speed whose peak is 1.46 times the mean, and
without overshoot. Its three poles are those that come nearest to the polynomial of minimum jerk; the numbers are
those of the iCub's controllers, for a time of 1 s.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.errors import RefusedError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

_A, _B, _C = -150.765868956161, -84.9812819469538, -15.9669610709384
#: The shortest time, in periods.
_SHORTEST = 10


class MinimumJerkFilter:
    """A filter for ``size`` joints, called once a ``period`` (s). ``duration`` (s) may change at any time."""

    def __init__(self, size: int, period: float, duration: float) -> None:
        self.period = period
        self._inputs = np.zeros((2, size))
        self._outputs = np.zeros((2, size))
        self._duration = self.duration = duration

    @property
    def duration(self) -> float:
        """How long a step takes (s); at least ten periods."""
        return self._duration

    @duration.setter
    def duration(self, value: float) -> None:
        if not value > 0.0:
            raise RefusedError(f"a motion takes a time above 0 s, not {value}")
        self._duration = time = max(value, _SHORTEST * self.period)
        a, b, c, k = _A / time**3, _B / time**2, _C / time, 2.0 / self.period
        first = k * (k - c) - b
        self._gain = -a / first
        self._feedback = -2.0 * (k * k + b) / first, (k * (k + c) - b) / first

    def reset(self) -> None:
        """Begin at rest."""
        self._inputs[:] = 0.0
        self._outputs[:] = 0.0

    def step(self, left: ArrayLike) -> NDArray[np.float64]:
        """Return the speeds, a second, by what is left of the ways, in the unit of these."""
        now = np.asarray(left, dtype=np.float64)
        (before, earlier), (output, second) = self._inputs, self._outputs
        speed: NDArray[np.float64] = (
            self._gain * (now + 2.0 * before + earlier) - self._feedback[0] * output - self._feedback[1] * second
        )
        self._inputs = np.array([now, before])
        self._outputs = np.array([speed, output])
        return speed
