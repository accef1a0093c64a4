"""Setpoint trajectories of all axes, computed a block of milliseconds ahead.

The setpoint of an axis is a polynomial of the fifth degree in time, and after its end a straight line. A minimum-jerk
move is the polynomial that begins with the current position, speed and acceleration of the setpoint and ends at rest;
from rest that is the well-known ``10 s³ - 15 s⁴ + 6 s⁵`` (Flash and Hogan 1985). The acceleration at its begin is
limited to the greatest one of a move from rest. A change of speed is a parabola, and goes on as a line. All axes are
evaluated for a block of steps at once, so a step only looks up a row.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.devices.fake_axes import LEAST_MOVE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray

#: The number of steps of a block.
BLOCK = 64
_DEGREE = 5
#: The greatest acceleration of a minimum-jerk move from rest, as a factor of distance / duration².
_GREATEST = 10 / np.sqrt(3)


class Setpoints:
    """The setpoints of some axes (deg, deg/s), at steps of ``step`` seconds. Times are numbers of steps.

    ``positions`` and ``velocities`` hold the rows of the steps from ``begin`` on, multiplied by ``scales``, which
    convert deg and deg/s to the units of the controllers. Not thread-safe.
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
        count = len(positions)
        self._step = step
        self._scale = np.broadcast_to(np.asarray(scales[0], dtype=np.float64), positions.shape)
        self._speed_scale = np.broadcast_to(np.asarray(scales[1], dtype=np.float64), positions.shape)
        self.minimum = minimum.copy()
        self.maximum = maximum.copy()
        self._coefficients = np.zeros((_DEGREE + 1, count))
        self._coefficients[0] = positions
        self._from = np.zeros(count)  # the step at which the polynomial begins
        self._duration = np.zeros(count)  # s
        self._line = np.zeros(count)  # deg/s after its end
        self._busy = np.zeros(count)  # s from the begin until the motion is done
        self.begin = begin
        self._positions = np.empty((BLOCK, count))
        self._velocities = np.empty((BLOCK, count))
        #: The rows of the block, as views that need not be made at every step.
        self.positions = list(self._positions)
        self.velocities = list(self._velocities)
        self.fill(begin)

    def fill(self, begin: int) -> None:
        """Compute the block that starts at a step."""
        self.begin = begin
        positions, velocities, _ = self._evaluate(begin, BLOCK, slice(None))
        np.multiply(positions, self._scale, out=self._positions)
        np.multiply(velocities, self._speed_scale, out=self._velocities)

    def at(self, now: int, axes: NDArray[np.intp]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return position, velocity and acceleration of axes at a step."""
        positions, velocities, accelerations = self._evaluate(now, 1, axes)
        return positions[0], velocities[0], accelerations[0]

    def _evaluate(
        self, begin: int, steps: int, axes: NDArray[np.intp] | slice
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        c = self._coefficients[:, axes]
        since = (np.arange(begin, begin + steps)[:, None] - self._from[axes]) * self._step
        duration = self._duration[axes]
        t = np.minimum(since, duration)
        moving = since < duration
        position = c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5]))))
        velocity = c[1] + t * (2 * c[2] + t * (3 * c[3] + t * (4 * c[4] + t * 5 * c[5])))
        acceleration = 2 * c[2] + t * (6 * c[3] + t * (12 * c[4] + t * 20 * c[5]))
        line = self._line[axes]
        position += line * (since - t)
        velocity = np.where(moving, velocity, line)
        # A setpoint stops at a limit. One that begins outside of the limits may only move inwards.
        bounded = np.clip(position, np.minimum(self.minimum[axes], c[0]), np.maximum(self.maximum[axes], c[0]))
        within = bounded == position
        return bounded, velocity * within, acceleration * (moving & within)

    def _begin(
        self, axes: NDArray[np.intp], now: int, duration: FloatArray, line: FloatArray, least: float = 0.0
    ) -> None:
        self._from[axes] = now
        self._duration[axes] = duration
        self._line[axes] = line
        self._busy[axes] = np.maximum(duration, least)

    def _refresh(self, axes: NDArray[np.intp], now: int) -> None:
        """Recompute the rest of the block for axes with a new trajectory."""
        row = max(0, now - self.begin)
        if row < BLOCK:
            positions, velocities, _ = self._evaluate(self.begin + row, BLOCK - row, axes)
            self._positions[row:, axes] = positions * self._scale[axes]
            self._velocities[row:, axes] = velocities * self._speed_scale[axes]

    def hold(self, axes: NDArray[np.intp], positions: FloatArray, now: int) -> None:
        """Set the setpoints to these positions at once, and hold them."""
        self._coefficients[:, axes] = 0.0
        self._coefficients[0, axes] = positions
        self._begin(axes, now, np.zeros(len(axes)), np.zeros(len(axes)))
        row = max(0, now - self.begin)
        self._positions[row:, axes] = positions * self._scale[axes]
        self._velocities[row:, axes] = 0.0

    def move(self, axes: NDArray[np.intp], targets: FloatArray, speeds: FloatArray, now: int) -> None:
        """Move to these positions with these mean speeds, from the current state of the setpoints."""
        position, velocity, acceleration = self.at(now, axes)
        distance = targets - position
        duration = np.maximum(np.abs(distance) / np.maximum(speeds, _SLOWEST), self._step)
        # A move of 0.1 deg in 5 ms needs 23 000 deg/s². A move of one second that began with that would overshoot far.
        most = _GREATEST * np.abs(distance) / duration**2
        acceleration = np.clip(acceleration, -most, most)
        # The six conditions: position, speed and acceleration at the beginning, and rest at the target.
        t = duration
        c = self._coefficients
        c[0, axes], c[1, axes], c[2, axes] = position, velocity, acceleration / 2
        c[3, axes] = (20 * distance - 12 * velocity * t - 3 * acceleration * t**2) / (2 * t**3)
        c[4, axes] = (-30 * distance + 16 * velocity * t + 3 * acceleration * t**2) / (2 * t**4)
        c[5, axes] = (12 * distance - 6 * velocity * t - acceleration * t**2) / (2 * t**5)
        self._begin(axes, now, duration, np.zeros(len(axes)), LEAST_MOVE)
        self._refresh(axes, now)

    def run(self, axes: NDArray[np.intp], velocities: FloatArray, accelerations: FloatArray, now: int) -> None:
        """Change to these velocities with these accelerations, until the next command or a limit."""
        position, velocity, _ = self.at(now, axes)
        change = velocities - velocity
        duration = np.abs(change) / np.maximum(accelerations, _SLOWEST)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = np.where(duration > 0, change / duration, 0.0)
        c = self._coefficients
        c[:, axes] = 0.0
        c[0, axes], c[1, axes], c[2, axes] = position, np.where(duration > 0, velocity, velocities), slope / 2
        self._begin(axes, now, duration, velocities)
        self._refresh(axes, now)

    def done(self, axes: NDArray[np.intp] | int, now: int) -> NDArray[np.bool_]:
        """Return which axes have reached the ends of their trajectories, after ``LEAST_MOVE`` at the earliest."""
        ended: NDArray[np.bool_] = (now - self._from[axes]) * self._step >= self._busy[axes]
        return ended

    def within_limits(self, axes: NDArray[np.intp], positions: FloatArray) -> FloatArray:
        """Return positions clipped to the limits."""
        return np.clip(positions, self.minimum[axes], self.maximum[axes])

    def set_limits(self, axis: int, minimum: float, maximum: float, now: int) -> None:
        """Set the limits of an axis. A setpoint that is outside of them now stays where it is."""
        axes = np.array([axis])
        here = self.at(now, axes)[0]
        self.minimum[axis], self.maximum[axis] = minimum, maximum
        if minimum <= here[0] <= maximum:
            self._refresh(axes, now)
        else:
            self.hold(axes, here, now)


#: Least speed and acceleration (deg/s, deg/s²): a move at speed 0 would never end.
_SLOWEST = 1e-3
