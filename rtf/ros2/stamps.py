"""Times of a robot as times of this machine.

A robot's computer has a clock of its own, and a simulation begins at 0. The smallest difference between arrival and
stamp of the last messages is that of the clocks, and of the fastest message: so intervals stay those of the robot.
"""

from __future__ import annotations

import math

#: Clocks that differ less than this are taken for one, which a service of the network keeps (s).
_SAME = 0.1
#: Seconds after which a difference is forgotten, as clocks drift; and of a jump, such as that of a new simulation.
_WINDOW, _JUMP = 10.0, 1.0


class StampMapping:
    """Maps stamps. Used by one thread."""

    def __init__(self) -> None:
        self._last = -math.inf
        self._begun = -math.inf
        self._shared = False
        self._least, self._before = math.inf, math.inf

    def time_of(self, stamp: float, arrival: float) -> float:
        """Return when something stamped has been, by the clock of the arrival; never later than that."""
        if stamp < self._last - _JUMP or self._last == -math.inf:
            self._begun, self._least, self._before = arrival, math.inf, math.inf
            self._shared = abs(arrival - stamp) < _SAME
        self._last = stamp
        if self._shared and abs(arrival - stamp) < _SAME:
            return min(stamp, arrival)
        self._shared = False
        if arrival - self._begun > _WINDOW:
            self._begun, self._before, self._least = arrival, self._least, math.inf
        self._least = min(self._least, arrival - stamp)
        return min(stamp + min(self._least, self._before), arrival)
