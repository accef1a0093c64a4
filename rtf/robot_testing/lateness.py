"""Whether a test has kept up with the robot: what a machine that is too busy does is no fault of the robot."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

#: So many periods between two beats of a loop are too many: there was to be another one.
_LATE = 1.75
#: So many periods are too many on the average.
_SLOW = 1.5
_FEWEST = 2


def lateness(beats: ArrayLike, period: float) -> str:
    """What is wrong with the times (s) at which a loop of that ``period`` (s) did its work; "" where it kept up.

    A loop in lockstep always does, for there time waits for it.
    """
    gaps = np.diff(np.asarray(beats, dtype=np.float64))
    if not gaps.size:
        return ""
    usual = f"its period is {1e3 * period:.0f} ms"
    longest, mean = float(gaps.max()), float(gaps.mean())
    if longest > _LATE * period:
        return f"the loop of this test stood still for {1e3 * longest:.0f} ms, as this machine is too busy; {usual}"
    if gaps.size >= _FEWEST and mean > _SLOW * period:
        return f"the loop of this test takes {1e3 * mean:.0f} ms a round, as this machine is too busy; {usual}"
    return ""
