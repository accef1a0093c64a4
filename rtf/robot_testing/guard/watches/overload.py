"""Overload: a motor with more than its nominal current for too long (I²t).

A motor carries its nominal current continuously. The heat beyond that is the time integral of *i² - nominal²*; its
bound is that of the peak current for ``peak_time``. It cools down by the same integral.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.guard.watches.joint_state import JointBounds, JointState


def overload(state: JointState, bounds: JointBounds) -> FloatArray:
    """Return the used share of the permitted heat, 1/s; 0 where nominal currents are unknown."""
    nominal = bounds.nominal**2
    with np.errstate(invalid="ignore"):
        used = (state.currents**2 - nominal) / ((bounds.peak**2 - nominal) * bounds.profile.peak_time)
    return np.where(np.isfinite(used), used, 0.0)
