"""Gains of the boards' position controllers: the same bandwidth for every axis.

A critically damped second-order loop of angular frequency ``w`` around an inertia ``I`` needs ``kp = I w²`` and
``kd = 2 I w``; the integral removes the error that gravity and friction cause, at half a hertz. A motor that is fed
with a voltage brakes by itself in proportion to its speed: ``kd`` is less by that, and as much is added for the speed
of the setpoint. Gains are in the units of the boards, per cent of duty cycle per degree, or metre.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.interfaces import Pid

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model import Axis

#: Bandwidth of the position loop (Hz): far below the stability limit at 1 kHz; it follows a minimum-jerk move within
#: 0.2 degrees.
BANDWIDTH = 10.0
_INTEGRAL = 0.5
#: The least share of the damping that is the controller's: some motors brake more than the loop needs.
_LEAST_DAMPING = 0.1
#: Per cent of duty cycle.
FULL = 100.0


def position_pids(axes: Sequence[Axis], inertia: FloatArray, damping: FloatArray) -> list[Pid]:
    """Return the gains of each axis for its effective inertia (kg m²) and the damping by its motors (Nm s/rad)."""
    w = 2 * math.pi * BANDWIDTH
    percent_a_degree = np.array([axis.internal * FULL / axis.max_torque for axis in axes])
    kp = inertia * w * w * percent_a_degree
    whole = 2 * inertia * w
    kd = np.maximum(whole - damping, _LEAST_DAMPING * whole) * percent_a_degree
    ki = kp * 2 * math.pi * _INTEGRAL
    feedforward = damping * percent_a_degree
    return [
        Pid(kp=p, kd=d, ki=i, max_integral=FULL, max_output=FULL, feedforward=f)
        for p, d, i, f in zip(kp.tolist(), kd.tolist(), ki.tolist(), feedforward.tolist(), strict=True)
    ]
