"""Pressing: a joint in torque mode that stands still although its torque is not the one that holds it.

The output at the change to torque mode holds the joint against gravity. With more than friction can take beyond that, a
free joint moves.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot_testing.guard.watches.joint_state import FULL

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.guard.watches.joint_state import JointBounds, JointState


def pressing(state: JointState, bounds: JointBounds) -> FloatArray:
    """Return the used share of ``stalled_time``, 1/s."""
    presses = (state.effort >= bounds.profile.breakaway * FULL) & state.still & state.torquing
    return np.where(presses, 1.0 / bounds.profile.stalled_time, -np.inf)
