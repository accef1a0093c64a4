"""The joints of a fake board: their positions over time, by kinematics alone.

Not modelled: masses, forces, friction, controllers, delays. The position follows the trajectory, speed or setpoint
exactly; torques, currents and duty cycles are the commanded ones, and move nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import TRAJECTORY_MODES, VELOCITY_MODES, ControlMode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray

#: Shortest duration of a move (s), also to where the joint is: trajectories of boards have one, and clients take an
#: earlier *done* for that of the move before.
LEAST_MOVE = 0.05
#: Initial reference speed (deg/s) and acceleration (deg/s²).
SPEED, ACCELERATION = 10.0, 50.0


class FakeAxes:
    """Joints (deg, deg/s, deg/s²) that are moved by ``advance``. Not thread-safe.

    ``references`` holds the last setpoints of the modes that only report them: torques, currents, duty cycles.
    """

    def __init__(self, minima: FloatArray, maxima: FloatArray, now: float) -> None:
        count = len(minima)
        self.count = count
        self.minima, self.maxima = minima.copy(), maxima.copy()
        self.time = now
        self.positions, self.speeds, self.accelerations = np.zeros((3, count))
        self.reference_speeds = np.full(count, SPEED)
        self.reference_accelerations = np.full(count, ACCELERATION)
        self.targets, self.target_speeds, self.direct = np.zeros((3, count))
        self.references = {mode: np.zeros(count) for mode in _GIVEN_BACK}
        self.modes = [ControlMode.POSITION] * count
        self._masks: dict[frozenset[ControlMode], np.ndarray[tuple[int], np.dtype[np.bool_]]] = {}
        self._from, self._way, self._began = np.zeros((3, count))
        self._duration = np.ones(count)
        self.moving = np.zeros(count, dtype=bool)

    # Modes -------------------------------------------------------------------------------------------------------

    def enter(self, joint: int, mode: ControlMode) -> None:
        """Put a joint into a mode, at rest until a command. Its present mode changes nothing."""
        if mode is self.modes[joint]:
            return
        self.modes[joint] = mode
        self._masks.clear()
        self.moving[joint] = False
        self.targets[joint] = self.direct[joint] = self.positions[joint]
        self.target_speeds[joint] = 0.0
        if mode in self.references:
            self.references[mode][joint] = 0.0

    def measured(self, mode: ControlMode) -> FloatArray:
        """Return the measured torque, current or duty cycle: the setpoint in its mode, else zero."""
        return np.where(self._mask(_ALONE[mode]), self.references[mode], 0.0)

    def _mask(self, modes: frozenset[ControlMode]) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        mask = self._masks.get(modes)
        if mask is None:
            mask = self._masks[modes] = np.fromiter((mode in modes for mode in self.modes), bool, self.count)
        return mask

    # Commands ----------------------------------------------------------------------------------------------------

    def move(self, joints: Sequence[int], targets: FloatArray) -> None:
        """Start minimum-jerk trajectories of the joints in a trajectory mode. Duration: distance over speed."""
        for joint, target in zip(joints, targets, strict=True):
            if self.modes[joint] not in TRAJECTORY_MODES:
                continue
            self.targets[joint] = np.clip(target, self.minima[joint], self.maxima[joint])
            self._from[joint] = self.positions[joint]
            self._way[joint] = self.targets[joint] - self.positions[joint]
            self._began[joint] = self.time
            way, speed = abs(self._way[joint]), self.reference_speeds[joint]
            needed = way / speed if speed > 0 else np.inf if way else 0.0
            self._duration[joint] = max(needed, LEAST_MOVE)
            self.moving[joint] = True

    def run(self, joints: Sequence[int], speeds: FloatArray) -> None:
        """Set the target speeds of the joints in a velocity mode."""
        for joint, speed in zip(joints, speeds, strict=True):
            if self.modes[joint] in VELOCITY_MODES:
                self.target_speeds[joint] = speed
                self.moving[joint] = False

    def follow(self, joints: Sequence[int], positions: FloatArray) -> None:
        """Set the positions of the joints in position-direct mode, effective at once."""
        for joint, position in zip(joints, positions, strict=True):
            if self.modes[joint] is ControlMode.POSITION_DIRECT:
                self.direct[joint] = np.clip(position, self.minima[joint], self.maxima[joint])

    def refer(self, mode: ControlMode, joints: Sequence[int], values: FloatArray) -> None:
        """Set the torques, currents or duty cycles of the joints in this mode."""
        for joint, value in zip(joints, values, strict=True):
            if self.modes[joint] is mode:
                self.references[mode][joint] = value

    def stop(self, joints: Sequence[int]) -> None:
        """Stop the joints at their positions."""
        for joint in joints:
            self.moving[joint] = False
            self.targets[joint] = self.positions[joint]
            self.target_speeds[joint] = self.speeds[joint] = 0.0

    def declare(self, joints: Sequence[int], positions: FloatArray) -> None:
        """Declare that the joints are at these positions, at rest."""
        for joint, position in zip(joints, positions, strict=True):
            self.positions[joint] = self.direct[joint] = position
        self.stop(joints)

    # Time --------------------------------------------------------------------------------------------------------

    def advance(self, now: float) -> None:
        """Advance the time to ``now``."""
        step, self.time = now - self.time, now
        if step <= 0:
            return
        before = self.speeds.copy()
        running = self._mask(VELOCITY_MODES) & ~self.moving
        direct = self._mask(_DIRECT)
        self.speeds = np.zeros(self.count)
        if self.moving.any():
            self._pass_trajectories(now)
        if running.any():
            self._pass_speeds(running, before, step)
        if direct.any():
            self.speeds[direct] = (self.direct - self.positions)[direct] / step
            self.positions[direct] = self.direct[direct]
        self.accelerations = (self.speeds - before) / step

    def _pass_trajectories(self, now: float) -> None:
        moving = np.flatnonzero(self.moving)
        way, duration = self._way[moving], self._duration[moving]
        share = np.clip((now - self._began[moving]) / duration, 0.0, 1.0)
        # The minimum-jerk polynomial between rest and rest, and its derivative (Flash and Hogan 1985).
        place = share**3 * (10 - 15 * share + 6 * share**2)
        slope = 30 * share**2 * (1 - share) ** 2
        self.positions[moving] = self._from[moving] + way * place
        self.speeds[moving] = way * slope / duration
        self.moving[moving] = share < 1

    def _pass_speeds(
        self, running: np.ndarray[tuple[int], np.dtype[np.bool_]], before: FloatArray, step: float
    ) -> None:
        change = self.target_speeds - before
        acceleration = self.reference_accelerations  # 0: at once
        ramp = np.zeros(self.count)
        with np.errstate(over="ignore"):  # infinite means longer than the step
            np.divide(np.abs(change), acceleration, out=ramp, where=acceleration > 0)
        ramp = np.minimum(ramp, step)
        after = np.where(ramp < step, self.target_speeds, before + np.sign(change) * acceleration * ramp)
        way = (before + after) / 2 * ramp + after * (step - ramp)
        # A joint that starts beyond its limits, as set_encoders allows, moves no further out.
        low, high = np.minimum(self.minima, self.positions), np.maximum(self.maxima, self.positions)
        reached = np.clip(self.positions + way, low, high)
        after = np.where(reached == self.positions + way, after, 0.0)
        self.positions[running] = reached[running]
        self.speeds[running] = after[running]


_GIVEN_BACK = (ControlMode.TORQUE, ControlMode.CURRENT, ControlMode.PWM)
_ALONE = {mode: frozenset({mode}) for mode in ControlMode}
_DIRECT = _ALONE[ControlMode.POSITION_DIRECT]
