"""Real-time checks of a test: delays that this machine caused are no fault of the robot.

A check returns a reason why a value out of bounds cannot be blamed on the robot, or "". It is no verdict. In lockstep
no check is needed: the robot's time waits for the test, and every delay is the robot's.
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

#: Longest time between two ticks of a loop, in periods: more means that a tick was missed.
_LATE = 1.75
#: Longest mean time between two ticks, in periods.
_SLOW = 1.5
_FEWEST = 2
#: Tolerance between a command and the value that a board reports for it, %, as boards may quantize; and the least share
#: of states whose value has to match a command.
_SAME, _FOUND = 0.05, 0.5
#: Pressure stall information of Linux: the time for which some task has waited for a CPU, in microseconds.
_PRESSURE = Path("/proc/pressure/cpu")
_TOTAL = re.compile(rb"^some .*total=(\d+)", re.MULTILINE)
#: Share of the time with a waiting task above which this machine is overloaded.
_BUSY = 0.5
#: Recent pressure is that of one to two of these intervals, s of the machine's time.
_INTERVAL = 1.0


def loop_delay(ticks: ArrayLike, period: float) -> str:
    """Return how a loop of a ``period`` (s) fell behind, by the times (s) of its ticks; "" if it kept up.

    A loop in lockstep always keeps up.
    """
    gaps = np.diff(np.asarray(ticks, dtype=np.float64))
    if not gaps.size:
        return ""
    usual = f"its period is {1e3 * period:.0f} ms"
    longest, mean = float(gaps.max()), float(gaps.mean())
    if longest > _LATE * period:
        return f"the loop of this test was suspended for {1e3 * longest:.0f} ms, as this machine is too busy; {usual}"
    if gaps.size >= _FEWEST and mean > _SLOW * period:
        return f"the loop of this test takes {1e3 * mean:.0f} ms a tick, as this machine is too busy; {usual}"
    return ""


def state_delay(ages: ArrayLike, period: float) -> str:
    """Return by how much states came late to a loop of a ``period`` (s); "" if they did not.

    ``ages`` (s) are those of the newest state at each tick. They are compared with their median, so that the offset of
    two clocks does not matter.
    """
    old = np.asarray(ages, dtype=np.float64)
    if not old.size:
        return ""
    beyond = float(old.max() - np.median(old))
    if not beyond > _LATE * period:
        return ""
    return f"a state came {1e3 * beyond:.0f} ms later than usual, as this machine or its network is too busy"


def command_delay(commands: Sequence[tuple[float, float]], seen_at: ArrayLike, seen: ArrayLike, period: float) -> str:
    """Return by how much commands reached a board late: it executed a command long after the next one; "" if not.

    ``commands`` are pairs of time (s) and value in their order, one a ``period`` (s). ``seen`` are the commands that
    the states of the times ``seen_at`` (s, of the same clock) report. The result is "" if these match no commands.
    """
    if len(commands) < _FEWEST:
        return ""
    times, values = np.array(commands, dtype=np.float64).T
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


def stalled_seconds() -> float:
    """Return the seconds since boot in which some task of this machine has waited for a CPU; 0 if unknown."""
    try:
        found = _TOTAL.search(_PRESSURE.read_bytes())
    except OSError:  # a kernel without it, or a container that hides it
        return 0.0
    return 1e-6 * int(found[1]) if found is not None else 0.0


class CpuPressure:
    """The CPU pressure since the creation of this object: the time in which some task has waited for a CPU."""

    def __init__(self) -> None:
        self._began, self._before = clock.monotonic(), stalled_seconds()

    @property
    def seconds(self) -> float:
        """The machine's time since the creation, in s."""
        return clock.monotonic() - self._began

    def share(self) -> float:
        """Return the share of that time in which some task waited for a CPU; 0 at the beginning."""
        seconds = self.seconds
        return (stalled_seconds() - self._before) / seconds if seconds > 0 else 0.0


class RecentCpuPressure:
    """The CPU pressure of the last one to two seconds. Call ``update`` periodically."""

    def __init__(self) -> None:
        self._before = self._now = CpuPressure()

    def update(self) -> None:
        """Drop old intervals. It is cheap enough for control loops: most calls only read the clock."""
        if self._now.seconds >= _INTERVAL:
            self._before, self._now = self._now, CpuPressure()

    def overload(self) -> str:
        """Return why this machine was overloaded just now; "" if it was not."""
        return overload(self._before.share())


def overload(pressure: float) -> str:
    """Return the reason that a machine with this CPU pressure, a share of time, is overloaded; "" if it is not."""
    if pressure <= _BUSY:
        return ""
    return f"this machine is too busy: for {min(1.0, pressure):.0%} of the time a task waited for a CPU"
