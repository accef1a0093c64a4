"""What dry friction does to a joint under a position controller: it stands until the controller overcomes it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray, Pid


def friction_reach(pid: Pid, friction: float) -> float:
    """Return the error (deg) whose proportional part is the friction, in per cent of the greatest output."""
    return friction / 100.0 * abs(pid.max_output) / abs(pid.kp) if pid.kp else math.inf


def held_by_friction(time: FloatArray, reference: FloatArray, pid: Pid, friction: float) -> FloatArray:
    """Return where a joint is that follows a slow reference (deg), so that only friction counts; ``time`` in s.

    It moves while proportional and integral part of its controller together are the friction, and stands while they are
    less. Without a proportional part it stands.
    """
    if not pid.kp:
        return np.full_like(reference, reference[0])
    reach, rate, grown = friction_reach(pid, friction), abs(pid.ki / pid.kp), 0.0
    most = abs(pid.max_integral / pid.kp)
    here, before = float(reference[0]), float(time[0])
    positions = np.empty_like(reference)
    for place, (now, wanted) in enumerate(zip(time.tolist(), reference.tolist(), strict=True)):
        here = min(max(here, wanted - reach + grown), wanted + reach + grown)
        grown = min(max(grown + rate * (wanted - here) * (now - before), -most), most)
        before = now
        positions[place] = here
    return positions
