"""The torque sensors of the joints: at the output of each gear, sampled, late, with noise and an offset.

What friction takes behind them they do not see. A sensor is read a hundred times a second, as often as the estimator of
the iCub computes its torques from force-torque sensors, and shown after its delay. Noise and offsets of a run follow
from its seed.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from rtf.simulator.plant import TIMESTEP

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.simulator.plant import Plant

#: Steps between two samples.
SAMPLED = 10
#: Random numbers; a prime, so that it takes as many samples until they come again.
_DRAWN = 8191
_SEED = 0x70_4E


class TorqueSensors:
    """The sensors of all joints. ``sample`` is called every ``SAMPLED`` steps."""

    def __init__(self, plant: Plant, exerted: FloatArray, seed: int) -> None:
        """Read ``exerted``, the torques at the outputs of the gears (Nm, N)."""
        accuracy = plant.robot.sensors.joint_torques
        self._most = np.array([axis.max_torque for axis in plant.robot.axes])
        self._exerted = exerted
        random = np.random.default_rng([seed, _SEED])
        count = len(self._most)
        self._offset = random.uniform(-accuracy.offset, accuracy.offset, count) * self._most
        self._noise = random.standard_normal(_DRAWN + count)
        self._deviation = accuracy.noise * self._most
        #: The number of samples from the one that is shown to the last one.
        self.kept = 1 + round(accuracy.delay / (SAMPLED * TIMESTEP))
        self.samples: deque[FloatArray] = deque(maxlen=self.kept)  # the first one is shown (Nm)

    def rest(self, torques: FloatArray) -> None:
        """Start as if these torques had been there for a long time (Nm)."""
        self.samples.clear()
        self.samples.append(torques + self._offset)

    def sample(self, tick: int) -> None:
        """Read the sensors at a step; the noise of a step is the same in every run with this seed."""
        first = tick * len(self._most) % _DRAWN
        noise = self._noise[first : first + len(self._most)]
        self.samples.append(self._exerted + self._offset + noise * self._deviation)

    def torques(self) -> FloatArray:
        """Return what the sensors show now (Nm, N), as an array of its own."""
        return self.samples[0].copy()
