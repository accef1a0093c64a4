"""Moments at random, for faults that come and go."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np


class RandomMoments:
    """Moments of ``length`` seconds, ``rate`` of them in a second without one (a Poisson process).

    Each has a ``sign`` of its own, 1 or -1. ``now`` must not decrease from call to call.
    """

    def __init__(self, random: np.random.Generator, rate: float, length: float, now: float) -> None:
        self._random, self._rate, self._length = random, rate, length
        self._draw(now)

    def _draw(self, since: float) -> None:
        self._begin = since + float(self._random.exponential(1.0 / self._rate))
        self.sign = float(self._random.choice((-1.0, 1.0)))

    def holds(self, now: float) -> bool:
        """Whether it is one of the moments."""
        while now >= self._begin + self._length:
            self._draw(self._begin + self._length)
        return now >= self._begin
