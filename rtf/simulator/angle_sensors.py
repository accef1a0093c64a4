"""Sensors that measure the angles of joints as counts of a byte, such as the Hall effect sensors in fingers."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import IAnalogSensor, SensorReading
from rtf.robot.model.file import Accuracy
from rtf.simulator.simulated_sensors import SimulatedSensor

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model.file import AngleSensors
    from rtf.simulator.simulation import Simulation

_LARGEST = 255.0
#: Degrees of a bent joint.
_BENT = 90.0


class SimulatedAngles(SimulatedSensor, IAnalogSensor):
    """Sensors of joint angles on one port; whole numbers from 0 to 255.

    They follow the joints of the model, so a finger that an obstacle stops shows where it was stopped.
    """

    def __init__(self, name: str, settings: AngleSensors, simulation: Simulation) -> None:
        channels = settings.channels
        super().__init__(name, simulation, [Accuracy(noise=settings.noise)], each=len(channels))
        self._random = self._new_random()
        index = simulation.plant.robot.index
        #: The axis of each channel.
        self.axes = [index[axis] for axis, _ in channels]
        self._open = settings.open
        counts = (settings.bent - settings.open) / _BENT
        self._factors = counts * math.degrees(1.0) * np.array([share for _, share in channels])
        self._angles: FloatArray = simulation.data.actuator_length  # of all axes, rad
        self._reading = SensorReading(self._zero, 0.0)

    def _new_random(self) -> np.random.Generator:
        return np.random.default_rng([self.simulation.seed, ord(self.name[0])])

    def _begin_anew(self) -> None:
        super()._begin_anew()
        self._random = self._new_random()

    def _draw(self, count: int) -> FloatArray:
        """Return noise of its own, so that the noise of the other sensors does not depend on these."""
        return self._random.standard_normal(count)

    def channels(self) -> int:
        return len(self.axes)

    def read(self) -> SensorReading:
        boards = self._boards
        if self._measured_at != boards.tick:
            self._measured_at = boards.tick
            values = np.rint(self._open + self._factors * self._angles[self.axes] + self._next_noise())
            values.clip(0.0, _LARGEST, out=values)
            self._reading = SensorReading(values, boards.now)
        return self._reading

    def calibrate(self, channel: int | None = None, value: float | None = None) -> None:
        del channel, value
        raise RefusedError(f"{self.name}: sensors of angles are not calibrated by requests")
