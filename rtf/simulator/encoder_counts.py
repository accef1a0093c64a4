"""What boards compute from the counts of encoders: positions, speeds and accelerations of joints and rotors.

A board knows counts, and when it read them. A speed is the difference of two counts over a window, which is also the
mean speed in it; an acceleration is the difference of two such speeds. So speeds come in steps, one count in a window,
and half a window late, and the encoders of joints are read a moment before they are used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy import copyto, multiply, rint, subtract

from rtf.simulator.plant import TIMESTEP

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model.file import Encoders


class EncoderCounts:
    """The counts of the last steps. ``put`` and ``shown`` are called in every step.

    ``window`` is that of the speeds (s).
    """

    def __init__(self, ticks_a_radian: FloatArray, settings: Encoders) -> None:
        count = len(ticks_a_radian)
        self._late, self._speed_steps, self._steps = (
            round(seconds / TIMESTEP)
            for seconds in (settings.latency, settings.speed_window, settings.acceleration_window)
        )
        self.window = self._speed_steps * TIMESTEP
        self._depth = 1 + self._late + max(self._speed_steps, 2 * self._steps)
        #: Counts of joints, and angles of rotors in the units of the axes (rad, m): a row for each step.
        self._joints: list[FloatArray] = [*np.zeros((self._depth, count))]
        self._rotors: list[FloatArray] = [*np.zeros((self._depth, count))]
        self._to_speed = 1.0 / (ticks_a_radian * self.window)
        self._to_acceleration = 1.0 / (ticks_a_radian * (self._steps * TIMESTEP) ** 2)
        self._speeds = np.zeros(count)

    def fill(self, counts: FloatArray, rotors: FloatArray) -> None:
        """Start as if nothing had moved before."""
        for joints, angles in zip(self._joints, self._rotors, strict=True):
            joints[:], angles[:] = counts, rotors

    def put(self, tick: int, ticks: FloatArray, rotors: FloatArray) -> None:
        """Read the encoders of a step: the joints in ticks that are not whole yet, the rotors in rad or m."""
        row = tick % self._depth
        rint(ticks, out=self._joints[row])
        copyto(self._rotors[row], rotors)

    def shown(self, tick: int) -> tuple[FloatArray, FloatArray]:
        """Return the counts of the joints that boards have at a step, and their speeds (rad/s), not to be changed."""
        row = tick - self._late
        counts, speeds = self._joints[row % self._depth], self._speeds
        subtract(counts, self._joints[(row - self._speed_steps) % self._depth], out=speeds)
        multiply(speeds, self._to_speed, out=speeds)
        return counts, speeds

    def accelerations(self, tick: int) -> FloatArray:
        """Return the accelerations of the joints (rad/s²)."""
        found: FloatArray = self._change(self._joints, tick - self._late) * self._to_acceleration
        return found

    def rotors_before(self, tick: int) -> FloatArray:
        """Return the angles of the rotors at the begin of the window of their speeds (rad, m), not to be changed."""
        return self._rotors[(tick - self._speed_steps) % self._depth]

    def rotor_accelerations(self, tick: int) -> FloatArray:
        """Return the accelerations of the rotors (rad/s²)."""
        found = self._change(self._rotors, tick)
        found /= (self._steps * TIMESTEP) ** 2
        return found

    def _change(self, rows: list[FloatArray], last: int) -> FloatArray:
        """Return by how much the way in the last window is longer than that in the one before."""
        now, middle, first = (rows[(last - steps) % self._depth] for steps in (0, self._steps, 2 * self._steps))
        found: FloatArray = now - middle - (middle - first)
        return found
