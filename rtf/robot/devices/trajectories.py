"""Position trajectories of the axes of a motor board.

The setpoint of an axis is a polynomial of the fifth degree in time, and after its end a straight line. A minimum-jerk
move is the polynomial that begins with the current position, speed and acceleration of the setpoint and ends at rest;
from rest that is the well-known ``10 s³ - 15 s⁴ + 6 s⁵`` (Flash and Hogan 1985). The acceleration at its begin is
limited to the greatest one of a move from rest. A change of speed is a parabola, and goes on as a line.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray

#: Seconds after a position command in which the motion is not done, even to where the axis stands: trajectories of
#: boards have a least duration, and clients take an early *done* for that of the move before.
LEAST_MOVE = 0.05
#: The duration of the shortest trajectory, s.
SHORTEST = 1e-3
_DEGREE = 5
#: The greatest acceleration of a minimum-jerk move from rest, as a factor of distance / duration².
_GREATEST = 10 / np.sqrt(3)


class Trajectories:
    """The position setpoints of some axes (deg, deg/s, deg/s²). Not thread-safe.

    Times are numbers of steps, each of ``step`` seconds, and may be fractions. No move takes less than ``shortest``
    seconds.
    """

    def __init__(
        self,
        positions: FloatArray,
        minimum: FloatArray,
        maximum: FloatArray,
        step: float = 1.0,
        shortest: float = SHORTEST,
    ) -> None:
        count = len(positions)
        self._step = step
        self._shortest = shortest
        self.minimum = minimum.copy()
        self.maximum = maximum.copy()
        self._coefficients = np.zeros((_DEGREE + 1, count))
        self._coefficients[0] = positions
        self._from = np.zeros(count)  # the step at which the polynomial begins
        self._duration = np.zeros(count)  # s
        self._line = np.zeros(count)  # deg/s after its end
        self._busy = np.zeros(count)  # s from the begin until the motion is done

    @property
    def begins(self) -> FloatArray:
        """The step at which the present trajectory of each axis was commanded."""
        return self._from

    @property
    def final_velocities(self) -> FloatArray:
        """The velocity (deg/s) at which each axis goes on after the end of its trajectory."""
        return self._line

    def at(self, now: float, axes: NDArray[np.intp] | slice) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return position, velocity and acceleration of axes at a step."""
        positions, velocities, accelerations = self._evaluate(np.array([now]), axes)
        return positions[0], velocities[0], accelerations[0]

    def _evaluate(
        self, times: NDArray[Any], axes: NDArray[np.intp] | slice
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return positions, velocities and accelerations with a row for each time."""
        c = self._coefficients[:, axes]
        since = (times[:, None] - self._from[axes]) * self._step
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
        self, axes: NDArray[np.intp], now: float, duration: FloatArray, line: FloatArray, least: float = 0.0
    ) -> None:
        self._from[axes] = now
        self._duration[axes] = duration
        self._line[axes] = line
        self._busy[axes] = np.maximum(duration, least)

    def _changed(self, axes: NDArray[np.intp], now: float) -> None:
        """Take note of new trajectories; for subclasses that compute setpoints in advance."""

    def hold(self, axes: NDArray[np.intp], positions: FloatArray, now: float) -> None:
        """Set the setpoints to these positions at once, and hold them."""
        self._coefficients[:, axes] = 0.0
        self._coefficients[0, axes] = positions
        self._begin(axes, now, np.zeros(len(axes)), np.zeros(len(axes)))
        self._changed(axes, now)

    def move(self, axes: NDArray[np.intp], targets: FloatArray, speeds: FloatArray, now: float) -> None:
        """Move to these positions with these mean speeds, from the current state of the setpoints."""
        position, velocity, acceleration = self.at(now, axes)
        distance = targets - position
        duration = np.maximum(np.abs(distance) / np.maximum(speeds, _SLOWEST), self._shortest)
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
        self._changed(axes, now)

    def run(self, axes: NDArray[np.intp], velocities: FloatArray, accelerations: FloatArray, now: float) -> None:
        """Change to these velocities with these accelerations (0: at once), until the next command or a limit."""
        position, velocity, _ = self.at(now, axes)
        change = velocities - velocity
        duration = np.where(accelerations > 0, np.abs(change) / np.maximum(accelerations, _SLOWEST), 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = np.where(duration > 0, change / duration, 0.0)
        c = self._coefficients
        c[:, axes] = 0.0
        c[0, axes], c[1, axes], c[2, axes] = position, np.where(duration > 0, velocity, velocities), slope / 2
        self._begin(axes, now, duration, velocities)
        self._changed(axes, now)

    def done(self, axes: NDArray[np.intp] | int, now: float) -> NDArray[np.bool_]:
        """Return which axes have reached the ends of their trajectories, after ``LEAST_MOVE`` at the earliest."""
        ended: NDArray[np.bool_] = (now - self._from[axes]) * self._step >= self._busy[axes]
        return ended

    def within_limits(self, axes: NDArray[np.intp], positions: FloatArray) -> FloatArray:
        """Return positions clipped to the limits."""
        return np.clip(positions, self.minimum[axes], self.maximum[axes])

    def set_limits(self, axis: int, minimum: float, maximum: float, now: float) -> None:
        """Set the limits of an axis. A setpoint that is outside of them now stays where it is."""
        axes = np.array([axis])
        here = self.at(now, axes)[0]
        self.minimum[axis], self.maximum[axis] = minimum, maximum
        if minimum <= here[0] <= maximum:
            self._changed(axes, now)
        else:
            self.hold(axes, here, now)


#: Least speed and acceleration (deg/s, deg/s²): a move at speed 0 would never end.
_SLOWEST = 1e-3
