"""The joint controllers of the boards, computed for all axes in every simulated millisecond.

One controller serves all modes; the modes differ in its parameters, which are set when a mode changes::

    torque = kp (setpoint - position) + kd (speed of the setpoint - speed) + base

``base`` is the sum of the integral of the error and a constant, the bias. Position modes have the gains of the position
controller; a compliant joint has its stiffness and damping instead; in torque, current and PWM mode the gains are zero
and the bias is the commanded effort; an idle joint has zeros only.

The units are those of encoders and physics engine (encoder ticks, rad/s, Nm), which saves conversions. The drives of
the model saturate torques, so only joints with a limit of their own are limited here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy import add, maximum, minimum, multiply, subtract

from rtf.simulator.setpoints import BLOCK

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray
    from rtf.simulator.setpoints import SetpointBlocks

#: Steps between two updates of the integral, which is slow.
INTEGRATION = 4


class JointControllers:
    """The parameters of the controllers, arrays with a column for each axis, and their step.

    ``torque`` is the output array. Positions are measured ones, in encoder ticks.
    """

    def __init__(self, torque: FloatArray) -> None:
        count = len(torque)
        self.torque = torque
        self.kp_kd = np.zeros((2, count))  # Nm a tick, Nm s/rad
        self.ki = np.zeros(count)  # Nm a tick, for each addition
        self.limit = np.full(count, np.inf)  # Nm, if it is less than the limit of the drive
        self._base = np.zeros(count)
        self._bias = np.zeros(count)
        self._errors = np.zeros((2, count))  # ticks, rad/s
        self._parts = np.zeros((2, count))
        self._scratch = np.zeros(count)
        self._position_errors, self._speed_errors = self._errors
        self._of_position, self._of_speed = self._parts

    @property
    def errors(self) -> FloatArray:
        """Setpoint minus position, in ticks."""
        return self._position_errors

    @property
    def bias(self) -> FloatArray:
        """The constant part (Nm)."""
        return self._bias

    @property
    def integral(self) -> FloatArray:
        """The integral part (Nm)."""
        return self._base - self._bias

    def set_integral(self, axis: int, torque: float) -> None:
        """Set the integral part of an axis (Nm)."""
        self._base[axis] = torque + self._bias[axis]

    def add_to_integral(self, axes: NDArray[np.intp], torques: FloatArray) -> None:
        """Add to the integral parts of some axes (Nm)."""
        self._base[axes] += torques

    def clip_integral(self, most: FloatArray) -> None:
        """Limit the integral parts to ``-most .. most`` (Nm)."""
        gathered = self._scratch
        subtract(self._base, self._bias, out=gathered)
        minimum(gathered, most, out=gathered)  # minimum and maximum together are twice as fast as clip
        maximum(gathered, -most, out=gathered)
        add(gathered, self._bias, out=self._base)

    def set_bias(self, axis: int, torque: float) -> None:
        """Set the constant part of an axis (Nm); the integral part stays."""
        self._base[axis] += torque - self._bias[axis]
        self._bias[axis] = torque

    def step(self, tick: int, setpoints: SetpointBlocks, positions: FloatArray, speeds: FloatArray) -> None:
        """Compute the torques of a step. Flat and without allocations: it is called a thousand times a second."""
        row = tick - setpoints.begin
        if row >= BLOCK:
            setpoints.fill(tick)
            row = 0
        subtract(setpoints.positions[row], positions, out=self._position_errors)
        subtract(setpoints.velocities[row], speeds, out=self._speed_errors)
        multiply(self.kp_kd, self._errors, out=self._parts)
        add(self._of_position, self._of_speed, out=self._scratch)
        add(self._scratch, self._base, out=self.torque)
        if not tick % INTEGRATION:
            multiply(self._position_errors, self.ki, out=self._scratch)
            add(self._base, self._scratch, out=self._base)

    def limit_torque(self) -> None:
        """Saturate the torques at the limits."""
        minimum(self.torque, self.limit, out=self.torque)
        maximum(self.torque, -self.limit, out=self.torque)
