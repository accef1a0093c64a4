"""Saturation: a controller that gives all it has for too long, whatever hinders its joint."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot_testing.guard.watches.joint_state import FULL

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.guard.watches.joint_state import JointBounds, JointState

#: Share of the full duty cycle that counts as all of it: boards round, and measure what their bridges gave.
_ALL = 0.95


def saturation(state: JointState, bounds: JointBounds) -> FloatArray:
    """Return the used share of ``saturated_time``, 1/s. Where a test commands the output there is no controller."""
    full = (np.abs(state.duties) >= _ALL * FULL) & ~state.commanded
    return np.where(full, 1.0 / bounds.profile.saturated_time, -np.inf)
