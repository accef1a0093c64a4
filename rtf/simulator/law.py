"""The law by which the boards drive their motors: what is computed for all axes in every simulated millisecond.

One law serves all modes, as what differs between them is put into its numbers when a mode changes, and not looked at in
every step::

    torque = kp (reference - position) + kd (speed of the reference - speed) + base

``base`` is what the integral of the error has gathered and a constant, the bias. A position mode has the gains of the
position controller; a compliant joint has stiffness and damping in their place; in torque, current and PWM mode the
gains are zero and the bias is what was asked for; an idle joint has nothing.

The numbers are those of the machine (ticks, rad/s, Nm), so that nothing has to be converted; and the drives of the
model cut off torques that they cannot give, so that nothing has to be limited that has no limit of its own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy import add, maximum, minimum, multiply, subtract

from rtf.simulator.references import BLOCK

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray
    from rtf.simulator.references import References

#: Steps between two additions to the integral, which is slow enough for that.
INTEGRATION = 4


class ControlLaw:
    """The numbers of the law, each with a column an axis, and its step.

    ``torque`` is where the result goes. ``positions`` are measured ones, in ticks.
    """

    def __init__(self, torque: FloatArray) -> None:
        count = len(torque)
        self.torque = torque
        self.kp_kd = np.zeros((2, count))  # Nm a tick, Nm s/rad
        self.ki = np.zeros(count)  # Nm a tick, for each addition
        self.limit = np.full(count, np.inf)  # Nm, where it is less than what the drive gives
        self._base = np.zeros(count)
        self._bias = np.zeros(count)
        self._errors = np.zeros((2, count))  # ticks, rad/s
        self._parts = np.zeros((2, count))
        self._scratch = np.zeros(count)
        self._position_errors, self._speed_errors = self._errors
        self._of_position, self._of_speed = self._parts

    @property
    def errors(self) -> FloatArray:
        """Reference minus position, in ticks."""
        return self._position_errors

    @property
    def bias(self) -> FloatArray:
        """The constant part (Nm)."""
        return self._bias

    @property
    def integral(self) -> FloatArray:
        """What the integral has gathered (Nm)."""
        return self._base - self._bias

    def set_integral(self, axis: int, torque: float) -> None:
        """Let the integral of an axis be this (Nm)."""
        self._base[axis] = torque + self._bias[axis]

    def add_to_integral(self, axes: NDArray[np.intp], torques: FloatArray) -> None:
        """Let the integrals of some axes be so much more (Nm)."""
        self._base[axes] += torques

    def clip_integral(self, most: FloatArray) -> None:
        """Let no integral be greater (Nm)."""
        gathered = self._scratch
        subtract(self._base, self._bias, out=gathered)
        minimum(gathered, most, out=gathered)  # both twice as quick as clip
        maximum(gathered, -most, out=gathered)
        add(gathered, self._bias, out=self._base)

    def set_bias(self, axis: int, torque: float) -> None:
        """Let the constant part of an axis be this (Nm); the integral stays."""
        self._base[axis] += torque - self._bias[axis]
        self._bias[axis] = torque

    def step(self, tick: int, references: References, positions: FloatArray, speeds: FloatArray) -> None:
        """Compute the torques of a step. Flat and without allocations: it is called a thousand times a second."""
        row = tick - references.begin
        if row >= BLOCK:
            references.fill(tick)
            row = 0
        subtract(references.positions[row], positions, out=self._position_errors)
        subtract(references.velocities[row], speeds, out=self._speed_errors)
        multiply(self.kp_kd, self._errors, out=self._parts)
        add(self._of_position, self._of_speed, out=self._scratch)
        add(self._scratch, self._base, out=self.torque)
        if not tick % INTEGRATION:
            multiply(self._position_errors, self.ki, out=self._scratch)
            add(self._base, self._scratch, out=self._base)

    def limit_torque(self) -> None:
        """Cut the torques off at the limits."""
        minimum(self.torque, self.limit, out=self.torque)
        maximum(self.torque, -self.limit, out=self.torque)
