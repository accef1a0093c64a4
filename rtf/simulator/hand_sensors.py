"""The Hall effect sensors in the joints of the fingers: fifteen numbers for each hand, as its board sends them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import IAnalogSensor, SensorReading
from rtf.simulator.axes import INDEX
from rtf.simulator.simulated_sensors import SimulatedSensor

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.simulator.simulation import Simulation

#: For each channel the axis that bends the joint, and the share of the axis: thumb, index, middle, ring and little
#: finger, each from the palm to the tip. One axis bends both outer joints of a finger, one all of the last two fingers.
_CHANNELS = (
    *(
        (f"{finger}_{axis}", share)
        for finger in ("thumb", "index", "middle")
        for axis, share in (("proximal", 1.0), ("distal", 0.5), ("distal", 0.5))
    ),
    *(("pinky", 1 / 3),) * 6,
)
#: Counts of an open joint, and of one that is bent by 90 deg. The board sends bytes; the ends are nominal.
_OPEN, _BENT = 240.0, 20.0
_COUNTS_PER_DEGREE = (_BENT - _OPEN) / 90.0
_LARGEST = 255.0
#: Standard deviation of the noise, counts.
_NOISE = 1.0


class SimulatedFingers(SimulatedSensor, IAnalogSensor):
    """The sensors of a hand, side ``l`` or ``r``; whole numbers from 0 to 255, smaller for a bent joint.

    They follow the joints of the model, so a finger that an obstacle stops shows where it was stopped.
    """

    def __init__(self, side: str, simulation: Simulation) -> None:
        super().__init__(f"{side}_hand_fingers", simulation, np.full(len(_CHANNELS), _NOISE))
        self._random = np.random.default_rng([simulation.seed, ord(side)])
        self._axes = [INDEX[f"{side}_{axis}"] for axis, _ in _CHANNELS]
        self._factors = _COUNTS_PER_DEGREE * math.degrees(1.0) * np.array([share for _, share in _CHANNELS])
        self._angles: FloatArray = simulation.data.actuator_length  # of all axes, rad
        self._reading = SensorReading(self._zero, 0.0)

    def _begin_anew(self) -> None:
        super()._begin_anew()
        self._random = np.random.default_rng([self.simulation.seed, ord(self.name[0])])

    def _draw(self, count: int) -> FloatArray:
        """Return noise of its own, so that the noise of the other sensors does not depend on the hands."""
        return self._random.standard_normal(count)

    def channels(self) -> int:
        return len(_CHANNELS)

    def read(self) -> SensorReading:
        boards = self._boards
        if self._measured_at != boards.tick:
            self._measured_at = boards.tick
            values = np.rint(_OPEN + self._factors * self._angles[self._axes] + self._next_noise())
            values.clip(0.0, _LARGEST, out=values)
            self._reading = SensorReading(values, boards.now)
        return self._reading

    def calibrate(self, channel: int | None = None, value: float | None = None) -> None:
        del channel, value
        raise RefusedError(f"{self.name}: the sensors in the fingers are not calibrated by requests")
