"""Whether a test has kept up with the robot: what a machine that is too busy does is no fault of the robot.

What is said here is no verdict: it is why what is out of bounds cannot be held against the robot. Nothing of it can
happen in lockstep, where time waits for tests; what is late there is late by the robot, and is not to be asked about.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rtf import clock

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

#: So many periods between two beats of a loop are too many: there was to be another one.
_LATE = 1.75
#: So many periods are too many on the average.
_SLOW = 1.5
_FEWEST = 2
#: How far what a board drives may be from what it was told, %, for boards that count in steps; and the share of states
#: in which something that was told has to be found again.
_SAME, _FOUND = 0.05, 0.5
#: Where a Linux machine says for how long something has waited for a processor while there was none, in microseconds.
_PRESSURE = Path("/proc/pressure/cpu")
_TOTAL = re.compile(rb"^some .*total=(\d+)", re.MULTILINE)
#: The share of the time in which something waits, from which on a machine is too busy to judge others by.
_BUSY = 0.5
#: The last moments are between once and twice this long, s of the machine's time.
_MOMENTS = 1.0


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


def staleness(ages: ArrayLike, period: float) -> str:
    """What is wrong with the ages (s) of the newest states that a loop of that ``period`` (s) went by; "" if nothing.

    They are compared with their median, so that clocks that differ do no harm.
    """
    old = np.asarray(ages, dtype=np.float64)
    if not old.size:
        return ""
    beyond = float(old.max() - np.median(old))
    if not beyond > _LATE * period:
        return ""
    return f"a state came {1e3 * beyond:.0f} ms later than usual, as this machine or its network is too busy"


def tardiness(told: Sequence[tuple[float, float]], seen_at: ArrayLike, seen: ArrayLike, period: float) -> str:
    """What is wrong with how commands reached a board: it went on for too long with one that another had replaced.

    ``told`` are the commands with their times (s) in their order, one a ``period`` (s); ``seen`` is what the states of
    ``seen_at`` (s, of the same clock) say is driven. Nothing is said of a board that drives something else.
    """
    if len(told) < _FEWEST:
        return ""
    times, values = np.array(told, dtype=np.float64).T
    stamps, driven = np.asarray(seen_at, dtype=np.float64), np.asarray(seen, dtype=np.float64)
    lags = []
    for stamp, value in zip(stamps, driven, strict=True):
        same = np.flatnonzero((np.abs(values - value) <= _SAME) & (times <= stamp + period))
        if same.size:
            newer = int(same[-1]) + 1
            lags.append(max(0.0, float(stamp - times[newer])) if newer < times.size else 0.0)
    longest = max(lags, default=0.0)
    if len(lags) < _FOUND * stamps.size or longest <= _LATE * period:
        return ""
    return f"a command took {1e3 * longest:.0f} ms to its board, as this machine or its network is too busy"


def waited() -> float:
    """The seconds for which something on this machine has waited for a processor since it began; 0 if not known."""
    try:
        found = _TOTAL.search(_PRESSURE.read_bytes())
    except OSError:  # a kernel without it, or a container that hides it
        return 0.0
    return 1e-6 * int(found[1]) if found is not None else 0.0


class Waiting:
    """For how much of the machine's time since it was made something has waited for a processor."""

    def __init__(self) -> None:
        self._began, self._before = clock.monotonic(), waited()

    @property
    def seconds(self) -> float:
        """The machine's time that has passed."""
        return clock.monotonic() - self._began

    def share(self) -> float:
        """The share of that time; 0 before any has passed."""
        seconds = self.seconds
        return (waited() - self._before) / seconds if seconds > 0 else 0.0


class LastMoments:
    """Whether this machine has been too busy in the last second or two; ``pass_by`` is called again and again."""

    def __init__(self) -> None:
        self._before = self._now = Waiting()

    def pass_by(self) -> None:
        """Forget what is long ago. Called in loops that control joints: most of the time it only looks at the clock."""
        if self._now.seconds >= _MOMENTS:
            self._before, self._now = self._now, Waiting()

    def busyness(self) -> str:
        """See the function."""
        return busyness(self._before.share())


def busyness(waiting: float) -> str:
    """What to say of a machine on which something waited for a processor for such a share of the time; "" if little."""
    if waiting <= _BUSY:
        return ""
    return f"this machine is too busy: for {min(1.0, waiting):.0%} of the time something waited for a processor"
