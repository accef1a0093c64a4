"""What disturbs a joint: a reason why a value out of bounds is no fault of its own."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot_testing.judging.blame import Strength, accused
from rtf.robot_testing.motion.stop_evidence import stop_evidence

if TYPE_CHECKING:
    from rtf.robot_testing.motion.part import Part


def disturbance(part: Part, joint: int) -> str:
    """Return what disturbs a joint: another one that is broken or limp; "" if none is, or this joint is accused.

    A value out of bounds is no fault of a joint that another one shook meanwhile, or that a limp one carries, or that
    shares a motor which does not give what its drive says.
    """
    wrong = accused(one for one in stop_evidence(part, moved=joint) if one.strength is Strength.CERTAIN)
    if joint in wrong:
        return ""
    if wrong:
        return f"it was disturbed: {next(iter(wrong.values())).text}"
    return limpness(part, joint)


def limpness(part: Part, joint: int) -> str:
    """Return which other joints were left without power, as a reason why a joint is disturbed; "" if none."""
    if part.guard is None:
        return ""
    limp = [part.names[one] for one in range(part.axes) if one != joint and part.guard.is_excluded(one)]
    return f"it was disturbed: without power are {', '.join(limp)}" if limp else ""
