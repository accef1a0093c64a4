"""Stall: a joint that does not follow its setpoint, although its motor works.

A healthy joint moves towards its setpoint as soon as its motor gives more than friction takes. A joint that stands
still with such an output, and with a following error that no resting joint has, is blocked, or has no torque.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot_testing.guard.watches.joint_state import FULL

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.guard.watches.joint_state import JointBounds, JointState


def may_stall(state: JointState, bounds: JointBounds) -> NDArray[np.bool_]:
    """Return the joints whose following errors matter: they have to be asked for."""
    works = state.effort >= bounds.profile.breakaway * FULL
    suspects: NDArray[np.bool_] = works & state.still & state.stiff & state.following
    return suspects


def stall(state: JointState, bounds: JointBounds) -> FloatArray:
    """Return the used share of ``stalled_time``, 1/s."""
    stalled = may_stall(state, bounds) & (np.abs(state.errors) > bounds.profile.stalled_error)
    return np.where(stalled, 1.0 / bounds.profile.stalled_time, -np.inf)
