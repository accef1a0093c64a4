"""Periodic loop that commands joints: ticks at multiples of its period, independent of the time the commands take."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot_testing.motion.routines import Guarded


def ticks(part: Guarded, period: float, seconds: float) -> Iterator[float]:
    """Yield the seconds since the beginning, at every tick for ``seconds``; the part's guard watches before each.

    Missed ticks are skipped, and the following ones keep their times. Raises GuardError.
    """
    begin = part.clock.now()
    count = max(1, math.ceil(seconds / period - _ROUNDING))
    tick = 0
    while tick < count:
        yield part.clock.now() - begin
        tick = max(tick + 1, math.ceil((part.clock.now() - begin) / period - _ROUNDING))
        wait = begin + tick * period - part.clock.now()
        if wait > 0:
            part.clock.sleep(wait)
        if part.guard is not None:
            part.guard.watch()


#: Share of a period that clocks of millisecond resolution may be short of its multiple.
_ROUNDING = 1e-3
