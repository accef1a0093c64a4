"""Exclusion of joints that are outside of their limits before a test begins, so that the others can be tested."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot_testing.motion.part import PACE

if TYPE_CHECKING:
    from rtf.robot_testing.motion.part import Part

#: Speed of a part at rest, deg/s, and the most time to wait for it, s.
_CALM, _PATIENCE = 2.0, 5.0
#: Time that a joint without power may take to start falling, s.
_FALLING = 1.0


def exclude_joints_out_of_limits(part: Part) -> list[int]:
    """Wait until a part is at rest, exclude the joints whose encoders are far outside of their limits; return these.

    A position controller would drive such a joint with full power.
    """
    guard = part.guard
    if guard is None:
        return []
    _wait_for_rest(part)
    excluded = []
    where = part.board.encoders()
    for joint in range(part.axes):
        beyond = float(max(part.low[joint] - where[joint], where[joint] - part.high[joint]))
        if beyond > guard.limits.beyond:
            here, far = part.shown(joint, where[joint], ".1f"), part.shown(joint, beyond, ".1f")
            guard.exclude(joint, f"it shows {here}, {far} beyond its limits")
            excluded.append(joint)
    if excluded:
        part.clock.sleep(_FALLING)
        _wait_for_rest(part)
    return excluded


def _wait_for_rest(part: Part) -> None:
    """Wait without the guard: the test has not moved the part yet."""
    end = part.clock.now() + _PATIENCE
    while float(np.abs(part.board.encoder_speeds()).max()) > _CALM and part.clock.now() < end:
        part.clock.sleep(PACE)
