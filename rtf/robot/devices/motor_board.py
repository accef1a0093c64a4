"""The rules that every motor board obeys, over a driver of its hardware.

They are here once for all boards: modes and their transitions, trajectories, limits of commands, expiry of commands,
faults, and the sequence of a calibration. :class:`rtf.robot.devices.control_board.ControlBoard` has the interfaces of
a control board over them.

Commands expire: a velocity, torque, current or duty cycle ends some time after its last command, so that a joint whose
client has died stops; position moves end by themselves, and direct positions are held.
"""

from __future__ import annotations

import math
import threading
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from rtf.robot.control_modes import (
    HOLDING_MODES,
    POWERLESS,
    VELOCITY_MODES,
    Answer,
    ControlMode,
    InteractionMode,
    answer,
    mode_word,
)
from rtf.robot.devices.board_driver import DrivenBoard, Setpoints
from rtf.robot.errors import DeviceError, NotSupportedError, RefusedError
from rtf.robot.extended_state import ExtendedState, Field

if TYPE_CHECKING:
    from collections.abc import Sequence
    from contextlib import AbstractContextManager

    from numpy.typing import NDArray

    from rtf.robot.devices.board_axes import BoardAxis
    from rtf.robot.devices.board_driver import BoardDriver
    from rtf.robot.interfaces import FloatArray

#: The codes of faults that are found here; a driver's own ones begin at 10.
OVERCURRENT, OVERHEATED, ERROR_LIMIT = 1, 2, 3
#: The largest position that can be declared, deg.
FARTHEST = 1e6
_OVERLOADS = 5  # checks in a row with too great a current
_AT_REST = 100.0  # seconds after which an axis that was stopped has come to rest
#: Modes that the board enters by itself, and the modes before them.
_BEFORE = {
    ControlMode.CALIBRATION_DONE: ControlMode.CALIBRATING,
    ControlMode.POSITION: ControlMode.CALIBRATION_DONE,
}
_JOINTS = (Field.JOINT_POSITIONS, Field.JOINT_VELOCITIES, Field.JOINT_ACCELERATIONS)
_MODES = (Field.CONTROL_MODES, Field.INTERACTION_MODES)
_MOTORS = (Field.MOTOR_POSITIONS, Field.MOTOR_VELOCITIES, Field.MOTOR_ACCELERATIONS)


class MotorBoard(DrivenBoard):
    """One or several motor boards with one driver, whose axes are the columns of the arrays.

    All methods but ``update`` are called with ``lock`` held, so never two at the same time.
    """

    #: Steps of the trajectories a second.
    steps_a_second: ClassVar[int] = 1
    #: When the hardware last answered, s; -inf if it did not the last time.
    read_at: float = 0.0

    def __init__(self, driver: BoardDriver, lock: AbstractContextManager[object] | None = None) -> None:
        self.driver = driver
        self.lock: AbstractContextManager[object] = lock or threading.RLock()
        self.setpoints = Setpoints(self)

    # The cycle ---------------------------------------------------------------------------------------------------

    def start(self, axes: Sequence[BoardAxis]) -> None:
        """Initialize the axes and read the hardware: they are held where they are, in position mode, calibrated."""
        self._axes = axes
        self.set_up(axes, self.driver.couplings)
        valid = {*self.driver.measures, *_MODES}
        valid |= {motors for joints, motors in zip(_JOINTS, _MOTORS, strict=True) if joints in valid}
        self._valid = np.array([field in valid for field in Field])
        self._derived = [
            (joints, motors)
            for joints, motors in zip(_JOINTS, _MOTORS, strict=True)
            if motors not in self.driver.measures
        ]
        self.state = self._empty_state()
        for axis in range(self.count):
            self.driver.configure(axis)
        self._take(self.driver.time())
        self._hold(np.arange(self.count), self.measured(Field.JOINT_POSITIONS))

    def restart(self) -> None:
        self.start(self._axes)

    def _empty_state(self) -> ExtendedState:
        state = ExtendedState(self.count)
        state.valid[:] = self._valid
        return state

    def update(self) -> None:
        """Bring the state up to date, if the driver has no period of its own."""
        if self.driver.period is None:
            with self.lock:
                self.cycle(self.driver.time())

    def cycle(self, now: float) -> None:
        """Read, supervise and write once, at a time of the robot's clock."""
        self._take(now)
        self.supervise()
        if self.driver.period is not None:
            self.check_motors(self.state.currents, self.state.temperatures)
            self.driver.write(self.setpoints, self.mode)

    def _take(self, now: float) -> None:
        """Read the hardware into a new state: a reader in another thread keeps the one that it has."""
        state = self._empty_state()
        self.tick = now * self.steps_a_second
        try:
            self.driver.read(state)
        except DeviceError:
            self.read_at = -math.inf
            raise
        state.joint_positions += self.encoder_offsets
        for joints, motors in self._derived:
            np.dot(self.configured_couplings, state.floats[joints], out=state.floats[motors])
            state.floats[motors] *= self.configured_gearbox
        state.motor_positions += self.motor_offsets
        self.state = state
        self.read_at = now

    @property
    def now(self) -> float:
        """The time of the state, in seconds of the robot's clock."""
        return self.tick / self.steps_a_second

    @property
    def measured_at(self) -> float:
        """When the measurements of the state were made, in seconds of the robot's clock."""
        return self.driver.stamp(self.now)

    def measured(self, field: Field) -> NDArray[np.float64]:
        """Return the latest values of all axes, which may change. Raises NotSupportedError if they are not measured."""
        if not self.state.valid[field]:
            raise NotSupportedError(f"this board does not measure {field.name.lower().replace('_', ' ')}")
        return self.state.values(field)

    def snapshot(self) -> ExtendedState:
        """Return all measurements of one moment, as a state that may change; its modes are not filled in."""
        return self.state

    def shown_modes(self) -> NDArray[np.int32]:
        """Return what is shown of the modes: a row of control modes, and one of interaction modes."""
        return self.modes

    def controller_errors(self) -> FloatArray:
        """Return setpoint minus position (deg) of the axes whose positions are controlled, 0 of others."""
        errors = self.trajectories.at(self.tick, slice(None))[0] - self.measured(Field.JOINT_POSITIONS)
        return np.where(np.isin(self.mode, _HOLDING), errors, 0.0)

    def controller_outputs(self) -> FloatArray:
        """Return the outputs of the controllers (per cent of duty cycle)."""
        return self.measured(Field.DUTY_CYCLES)

    # Supervision -------------------------------------------------------------------------------------------------

    def supervise(self) -> None:
        """End commands that have expired, and enter modes that were planned. Counting is faster than ``any``."""
        if np.count_nonzero(self._deadline < self.now):
            for axis in np.flatnonzero(self._deadline < self.now).tolist():
                self._expire(axis)
        if np.count_nonzero(self.pid_error_limits):
            self._check_errors()
        while self._planned and self._planned[0][0] <= self.tick:
            _, axis, mode = self._planned.pop(0)
            if self.mode[axis] == _BEFORE[mode]:  # otherwise a fault occurred meanwhile
                self.enter(axis, mode)

    def check_motors(self, currents: FloatArray, temperatures: NDArray[np.floating]) -> None:
        """Put axes into fault whose motor has too much current for some checks, or is too hot.

        The current of an axis without power is none of its own: it is noise, or holds an axis that is coupled to it.
        """
        overload = self._overload
        overload += 1.0
        overload *= np.abs(currents * self._powered) > self.max_current
        if np.count_nonzero(overload >= _OVERLOADS):
            for axis in self._sound(overload >= _OVERLOADS):
                self._over_current(axis)
        if np.count_nonzero(temperatures > self.temperature_limit):
            for axis in self._sound(temperatures > self.temperature_limit):
                self.fault(axis, OVERHEATED, f"too hot: more than {self.temperature_limit[axis]:g} degrees")

    def _over_current(self, axis: int) -> None:
        self.fault(axis, OVERCURRENT, f"over-current: more than {self.max_current[axis]:g} A")

    def _sound(self, chosen: NDArray[np.bool_]) -> list[int]:
        """Return those of the chosen axes that are not in fault yet."""
        found: list[int] = np.flatnonzero(chosen & (self.mode != ControlMode.HARDWARE_FAULT)).tolist()
        return found

    def _check_errors(self) -> None:
        limits = self.pid_error_limits
        for axis in np.flatnonzero((limits > 0) & (np.abs(self.controller_errors()) > limits)).tolist():
            self.fault(axis, ERROR_LIMIT, f"the position is more than {limits[axis]:g} degrees off")

    def _expire(self, axis: int) -> None:
        """End the command of an axis. The last command can still be read."""
        self._deadline[axis] = np.inf
        self._expired[axis] = True
        if ControlMode(int(self.mode[axis])) in VELOCITY_MODES:
            self.trajectories.run(np.array([axis]), np.zeros(1), self.driver.stopping * self.degree[[axis]], self.tick)
        self.driver.configure(axis)
        self._send()

    def fault(self, axis: int, code: int, message: str) -> None:
        """Put an axis into hardware fault; only a forced idle ends it."""
        self.faults[axis] = (code, f"{self.names[axis]}: {message}")
        self._overload[axis] = 0
        self.enter(axis, ControlMode.HARDWARE_FAULT)

    def _send(self) -> None:
        """Write at once, if there is no period."""
        if self.driver.period is None:
            self.driver.write(self.setpoints, self.mode)

    # Modes -------------------------------------------------------------------------------------------------------

    def request_mode(self, axis: int, wanted: int) -> None:
        """Change the mode by the transition table. Raises RefusedError for a mode that must not be requested."""
        state = ControlMode(int(self.mode[axis]))
        result, after = answer(state, wanted)
        if result is Answer.REFUSED:
            raise RefusedError(f"{self.names[axis]}: {mode_word(wanted)} is not a mode that may be requested")
        if wanted not in self.driver.supported:
            raise RefusedError(f"{self.names[axis]}: this board does not have the mode {mode_word(wanted)}")
        if result is Answer.TAKEN and after is not state:
            self.enter(axis, after)

    def request_interaction(self, axis: int, wanted: int) -> None:
        """Make an axis stiff or compliant; the mode stays. Raises RefusedError where there is no torque sensing."""
        if wanted not in (InteractionMode.STIFF, InteractionMode.COMPLIANT):
            raise RefusedError(f"{self.names[axis]}: {wanted} is no interaction mode that may be requested")
        if wanted == InteractionMode.COMPLIANT and not self.torque_controlled[axis]:
            raise RefusedError(f"{self.names[axis]} cannot be compliant: it has no torque control")
        if wanted != self.interaction[axis]:
            self.interaction[axis] = wanted
            self.driver.configure(axis)

    def enter(self, axis: int, mode: ControlMode) -> None:
        """Put an axis into a mode, at rest where it is, with the torque or current that it has now."""
        before = ControlMode(int(self.mode[axis]))
        axes = np.array([axis])
        self._hold(axes, self.measured(Field.JOINT_POSITIONS)[axes])
        self.velocities[axis] = 0.0
        self._expired[axis] = False
        self._deadline[axis] = np.inf
        if mode is ControlMode.TORQUE:
            self.torques[axis] = self._effort(axis, before, Field.TORQUES)
        elif mode is ControlMode.CURRENT:
            self.currents[axis] = self._effort(axis, before, Field.CURRENTS)
        elif mode is ControlMode.PWM:
            self.duties[axis] = 0.0
        elif mode is ControlMode.CALIBRATION_DONE:
            self.calibrated[axis] = True
        self.mode[axis] = mode
        self._powered[axis] = mode not in POWERLESS
        self.driver.configure(axis)
        self._send()

    def _effort(self, axis: int, before: ControlMode, field: Field) -> float:
        """Return the present torque or current of an axis: 0 if it had no power, or does not measure it."""
        return 0.0 if before in POWERLESS or not self.snapshot().valid[field] else float(self.measured(field)[axis])

    def _hold(self, axes: NDArray[np.intp], positions: FloatArray) -> None:
        self.trajectories.hold(axes, positions, self.tick)
        self.targets[axes] = self.direct[axes] = positions

    def calibrate(self, axis: int) -> None:
        """Calibrate an axis, during which it takes no commands. Raises RefusedError for an axis in fault."""
        if self.mode[axis] == ControlMode.HARDWARE_FAULT:
            raise RefusedError(f"{self.names[axis]} is in fault and cannot be calibrated; force it to idle first")
        self._planned = [planned for planned in self._planned if planned[1] != axis]
        self.calibrated[axis] = False
        self.enter(axis, ControlMode.CALIBRATING)
        seconds, pause = self.driver.calibration_time
        end = self.tick + seconds * self.steps_a_second
        self._planned.append((end, axis, ControlMode.CALIBRATION_DONE))
        self._planned.append((end + pause * self.steps_a_second, axis, ControlMode.POSITION))
        self._planned.sort(key=lambda planned: planned[0])

    def end_calibration(self, axis: int) -> None:
        """End the calibration of an axis before its time is over, as its hardware has finished it."""
        own = [planned for planned in self._planned if planned[1] == axis]
        early = own[0][0] - self.tick if own else 0.0
        moved = [(tick - early if of == axis else tick, of, mode) for tick, of, mode in self._planned]
        self._planned = sorted(moved, key=lambda planned: planned[0])

    # Commands: axes as arrays of numbers, values of the same length ---------------------------------------------

    def accept(self, what: str, axes: list[int], modes: frozenset[ControlMode]) -> list[int]:
        """Return the places of the axes that are in one of the modes; commands to the others are ignored."""
        del what
        return [place for place, axis in enumerate(axes) if int(self.mode[axis]) in modes]

    def move(self, axes: NDArray[np.intp], targets: FloatArray) -> None:
        """Move along a trajectory; targets are clipped to the limits."""
        targets = self.trajectories.within_limits(axes, targets)
        self.targets[axes] = targets
        self.trajectories.move(axes, targets, self.move_speeds()[axes], self.tick)
        self._deadline[axes] = np.inf

    def move_speeds(self) -> FloatArray:
        """Return the speeds of moves of all axes: the reference speeds."""
        return self.speeds

    def run(self, axes: NDArray[np.intp], velocities: FloatArray, accelerations: FloatArray) -> None:
        """Move at velocities, until the limits or the expiry."""
        velocities = np.clip(velocities, -self.max_velocity[axes], self.max_velocity[axes])
        self.velocities[axes] = velocities
        self.trajectories.run(axes, velocities, accelerations, self.tick)
        self._renew(axes)

    def follow(self, axes: NDArray[np.intp], positions: FloatArray) -> None:
        """Set direct positions, clipped to the limits."""
        positions = self.trajectories.within_limits(axes, positions)
        self.direct[axes] = positions
        self.trajectories.hold(axes, positions, self.tick)

    def exert(self, axes: NDArray[np.intp], torques: FloatArray) -> None:
        """Exert torques, clipped to those of the drives."""
        self._drive_with(self.torques, axes, torques, self.max_torque)

    def drive_currents(self, axes: NDArray[np.intp], currents: FloatArray) -> None:
        """Drive currents, clipped to the peak currents."""
        self._drive_with(self.currents, axes, currents, self.peak_current)

    def drive(self, axes: NDArray[np.intp], duties: FloatArray) -> None:
        """Drive motors with duty cycles, clipped to their limits."""
        self._drive_with(self.duties, axes, duties, self.duty_limit)

    def _drive_with(self, into: FloatArray, axes: NDArray[np.intp], values: FloatArray, most: FloatArray) -> None:
        into[axes] = np.clip(values, -most[axes], most[axes])
        self._renew(axes)
        self._send()

    def stop(self, axes: NDArray[np.intp]) -> None:
        """Slow down to rest; the positions of rest become the targets."""
        self.velocities[axes] = 0.0
        self.trajectories.run(axes, np.zeros(len(axes)), self.driver.stopping * self.degree[axes], self.tick)
        self.targets[axes] = self.trajectories.at(self.tick + _AT_REST * self.steps_a_second, axes)[0]
        self._deadline[axes] = np.inf

    def _renew(self, axes: NDArray[np.intp]) -> None:
        self._deadline[axes] = self.now + self.driver.watchdog
        self._expired[axes] = False

    def expire_after(self, axes: NDArray[np.intp], seconds: float) -> None:
        """Let the present commands of axes expire after some seconds, not after those of the driver."""
        self._deadline[axes] = self.now + seconds

    # Settings ----------------------------------------------------------------------------------------------------

    def refresh(self, axis: int) -> None:
        """Apply a setting of an axis that was changed in the arrays."""
        self.driver.configure(axis)
        self.trajectories.set_limits(axis, float(self.minimum[axis]), float(self.maximum[axis]), self.tick)

    def set_max_current(self, axis: int, current: float) -> None:
        """Set the current at which an axis goes into fault; at 0 A it does so at once."""
        self.max_current[axis] = current
        self.driver.configure(axis)
        if current <= 0.0 and ControlMode(int(self.mode[axis])) is not ControlMode.HARDWARE_FAULT:
            self._over_current(axis)

    def shift_encoders(self, axes: NDArray[np.intp], values: FloatArray) -> None:
        """Set the encoder readings of axes; controlled axes continue from there."""
        shift = values - self.measured(Field.JOINT_POSITIONS)[axes]
        self.encoder_offsets[axes] += shift
        self.state.joint_positions[axes] += shift
        self._hold(axes, values)

    def shift_motor_encoders(self, axes: NDArray[np.intp], values: FloatArray) -> None:
        """Set the encoder readings of rotors."""
        shift = values - self.measured(Field.MOTOR_POSITIONS)[axes]
        self.motor_offsets[axes] += shift
        self.state.motor_positions[axes] += shift


_HOLDING = [int(mode) for mode in HOLDING_MODES]
