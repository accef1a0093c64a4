"""Joints that are out of hand before a test has begun: given up, so that the others can be tested."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot_testing.part import PACE

if TYPE_CHECKING:
    from rtf.robot_testing.part import Part

#: What is slow enough to begin with, deg/s, and how long a part that moves may take to get so slow, s.
_CALM, _PATIENCE = 2.0, 5.0
#: How long a joint without power may take to fall before it rests, s.
_FALLING = 1.0


def give_up_strays(part: Part) -> list[int]:
    """Wait until a part is calm, and leave joints idle that show to be far outside of their limits; returns these.

    A controller that looks at such an encoder turns its joint with all it has.
    """
    guard = part.guard
    if guard is None:
        return []
    _calm_down(part)
    strays = []
    where = part.board.encoders()
    for joint in range(part.axes):
        beyond = float(max(part.low[joint] - where[joint], where[joint] - part.high[joint]))
        if beyond > guard.limits.beyond:
            guard.give_up(joint, f"it shows {where[joint]:.1f} deg, {beyond:.1f} deg beyond its limits")
            strays.append(joint)
    if strays:
        part.clock.sleep(_FALLING)
        _calm_down(part)
    return strays


def _calm_down(part: Part) -> None:
    """Wait, without the guard: what moves was not moved by the test."""
    end = part.clock.now() + _PATIENCE
    while float(np.abs(part.board.encoder_speeds()).max()) > _CALM and part.clock.now() < end:
        part.clock.sleep(PACE)
