"""Beats of a loop that commands joints: at multiples of its period, whatever the commands themselves take."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot_testing.part import Part


def paced(part: Part, period: float, seconds: float) -> Iterator[float]:
    """Seconds since the beginning, at every beat for so long; the part's guard looks on before each.

    A beat that comes late is not made up for: the ones after it are where they would have been. Raises GuardError.
    """
    begin = part.clock.now()
    beats = max(1, math.ceil(seconds / period - _ROUNDING))
    beat = 0
    while beat < beats:
        yield part.clock.now() - begin
        beat = max(beat + 1, math.ceil((part.clock.now() - begin) / period - _ROUNDING))
        wait = begin + beat * period - part.clock.now()
        if wait > 0:
            part.clock.sleep(wait)
        if part.guard is not None:
            part.guard.watch()


#: Of a beat: what clocks that count milliseconds make of a multiple of a period.
_ROUNDING = 1e-3
