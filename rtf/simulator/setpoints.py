"""Position setpoints of all axes, computed a block of milliseconds ahead, so that a step only looks up a row."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.devices.trajectories import Trajectories

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray

#: The number of steps of a block.
BLOCK = 64


class SetpointBlocks(Trajectories):
    """Trajectories, and their values at each of the steps from ``begin`` on.

    ``positions`` and ``velocities`` hold the rows of these steps, multiplied by ``scales``, which convert deg and deg/s
    to the units of the controllers. Times are whole numbers of steps.
    """

    def __init__(
        self,
        positions: FloatArray,
        minimum: FloatArray,
        maximum: FloatArray,
        step: float,
        *,
        begin: int = 0,
        scales: tuple[FloatArray | float, FloatArray | float] = (1.0, 1.0),
    ) -> None:
        super().__init__(positions, minimum, maximum, step)
        self._scale = np.broadcast_to(np.asarray(scales[0], dtype=np.float64), positions.shape)
        self._speed_scale = np.broadcast_to(np.asarray(scales[1], dtype=np.float64), positions.shape)
        self._lead = np.ones(len(positions))
        self.begin = begin
        self._positions = np.empty((BLOCK, len(positions)))
        self._velocities = np.empty((BLOCK, len(positions)))
        #: The rows of the block, as views that need not be made at every step.
        self.positions = list(self._positions)
        self.velocities = list(self._velocities)
        self.fill(begin)

    def fill(self, begin: int) -> None:
        """Compute the block that starts at a step."""
        self.begin = begin
        positions, velocities, _ = self._evaluate(np.arange(begin, begin + BLOCK), slice(None))
        np.multiply(positions, self._scale, out=self._positions)
        np.multiply(velocities, self._speed_scale * self._lead, out=self._velocities)

    def lead(self, axis: int, factor: float, now: float) -> None:
        """Multiply the speeds of an axis in the blocks, for a controller that adds a share of the setpoint's speed."""
        if self._lead[axis] != factor:
            self._lead[axis] = factor
            self._changed(np.array([axis]), now)

    def _changed(self, axes: NDArray[np.intp], now: float) -> None:
        """Compute the rest of the block again for axes with a new trajectory."""
        row = max(0, int(now) - self.begin)
        if row < BLOCK:
            positions, velocities, _ = self._evaluate(np.arange(self.begin + row, self.begin + BLOCK), axes)
            self._positions[row:, axes] = positions * self._scale[axes]
            self._velocities[row:, axes] = velocities * (self._speed_scale[axes] * self._lead[axes])
