"""The joints of a fake board: where they are at a moment, by kinematics alone.

Not modelled: masses, forces, friction, controllers, delays. A joint is where its trajectory, speed or reference says;
torques, currents and duty cycles are what was asked for, and move nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import TRAJECTORY_MODES, VELOCITY_MODES, ControlMode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray

#: Seconds that a move lasts at least.
_SHORTEST = 1e-6
#: Of a joint at the beginning, in deg/s and deg/s².
SPEED, ACCELERATION = 10.0, 50.0


class FakeAxes:
    """So many joints (deg, deg/s, deg/s²), moved by ``advance``. Not for several threads at once.

    ``references`` hold what was last asked for in the modes that only give it back: torques, currents, duty cycles.
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
        """Put a joint into a mode, in which it rests until it is told something. The mode it is in changes nothing."""
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
        """What a joint gives of a torque, current or duty cycle: the reference in its mode, nothing else."""
        return np.where(self._mask(_ALONE[mode]), self.references[mode], 0.0)

    def _mask(self, modes: frozenset[ControlMode]) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        mask = self._masks.get(modes)
        if mask is None:
            mask = self._masks[modes] = np.fromiter((mode in modes for mode in self.modes), bool, self.count)
        return mask

    # Commands ----------------------------------------------------------------------------------------------------

    def move(self, joints: Sequence[int], targets: FloatArray) -> None:
        """Start a minimum-jerk trajectory for those in a mode that takes it; it lasts the way over the speed."""
        for joint, target in zip(joints, targets, strict=True):
            if self.modes[joint] not in TRAJECTORY_MODES:
                continue
            self.targets[joint] = np.clip(target, self.minima[joint], self.maxima[joint])
            self._from[joint] = self.positions[joint]
            self._way[joint] = self.targets[joint] - self.positions[joint]
            self._began[joint] = self.time
            speed = self.reference_speeds[joint]
            self._duration[joint] = max(abs(self._way[joint]) / speed, _SHORTEST) if speed > 0 else np.inf
            self.moving[joint] = self._way[joint] != 0

    def run(self, joints: Sequence[int], speeds: FloatArray) -> None:
        """Reach these speeds, for those in a mode that takes it."""
        for joint, speed in zip(joints, speeds, strict=True):
            if self.modes[joint] in VELOCITY_MODES:
                self.target_speeds[joint] = speed
                self.moving[joint] = False

    def follow(self, joints: Sequence[int], positions: FloatArray) -> None:
        """Be there at once, for those in position-direct mode."""
        for joint, position in zip(joints, positions, strict=True):
            if self.modes[joint] is ControlMode.POSITION_DIRECT:
                self.direct[joint] = np.clip(position, self.minima[joint], self.maxima[joint])

    def refer(self, mode: ControlMode, joints: Sequence[int], values: FloatArray) -> None:
        """Ask for torques, currents or duty cycles, of those in this mode."""
        for joint, value in zip(joints, values, strict=True):
            if self.modes[joint] is mode:
                self.references[mode][joint] = value

    def stop(self, joints: Sequence[int]) -> None:
        """Rest here."""
        for joint in joints:
            self.moving[joint] = False
            self.targets[joint] = self.positions[joint]
            self.target_speeds[joint] = self.speeds[joint] = 0.0

    def declare(self, joints: Sequence[int], positions: FloatArray) -> None:
        """Say that the joints are at these positions, and rest there."""
        for joint, position in zip(joints, positions, strict=True):
            self.positions[joint] = self.direct[joint] = position
        self.stop(joints)

    # Time --------------------------------------------------------------------------------------------------------

    def advance(self, now: float) -> None:
        """Let time pass until ``now``."""
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
        # The polynomial of least jerk between rest and rest, and its derivative (Flash and Hogan 1985).
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
        with np.errstate(over="ignore"):  # it takes longer than the step, however much
            np.divide(np.abs(change), acceleration, out=ramp, where=acceleration > 0)
        ramp = np.minimum(ramp, step)
        after = np.where(ramp < step, self.target_speeds, before + np.sign(change) * acceleration * ramp)
        way = (before + after) / 2 * ramp + after * (step - ramp)
        # A joint that begins beyond its limits, as encoders may say, goes no further out.
        low, high = np.minimum(self.minima, self.positions), np.maximum(self.maxima, self.positions)
        reached = np.clip(self.positions + way, low, high)
        after = np.where(reached == self.positions + way, after, 0.0)
        self.positions[running] = reached[running]
        self.speeds[running] = after[running]


_GIVEN_BACK = (ControlMode.TORQUE, ControlMode.CURRENT, ControlMode.PWM)
_ALONE = {mode: frozenset({mode}) for mode in ControlMode}
_DIRECT = _ALONE[ControlMode.POSITION_DIRECT]
