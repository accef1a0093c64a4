"""The motor boards of all parts together: encoders, setpoints, controllers, motors and modes of all axes at 1 kHz.

All arrays have a column for each axis, in the order of :attr:`rtf.robot.model.RobotModel.axes`, in degrees (metres of
prismatic axes) and per cent of duty cycle. The controller of the modes is in :mod:`rtf.simulator.controller`. Faults
are small functions in lists, which are empty in a healthy robot.

Watchdogs: a velocity, torque, current or duty cycle expires ``WATCHDOG`` seconds after its last command, so that a
joint whose client has died stops; position moves end by themselves, and direct positions are held.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

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
from rtf.robot.errors import RefusedError
from rtf.simulator.board_state import AMBIENT, BoardState
from rtf.simulator.controller import INTEGRATION
from rtf.simulator.plant import TIMESTEP
from rtf.simulator.position_gains import FULL

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray, Pid
    from rtf.simulator.plant import Plant

#: Seconds without a new command after which velocities, torques, currents and duty cycles expire.
WATCHDOG = 0.5
#: Steps between the slow work of the boards: supervision, temperatures.
SLOW = 10
#: Deceleration of a stop, degrees/s².
STOPPING = 1000.0
_OVERLOAD_TICKS = 5  # of the slow work: 50 ms
_THERMAL_TIME = 600.0  # s


class Boards(BoardState):
    """The motor boards. Not thread-safe: used by the simulation's loop, or by a command between two steps."""

    def __init__(self, plant: Plant, data: Any) -> None:
        super().__init__(plant, data)
        self._prepare()

    def _prepare(self) -> None:
        """Set the state of the robot after power-up: held at home."""
        count = self.count
        self._max_integral = np.zeros(count)  # Nm
        self._limited = False
        self._stiction = self._special = False
        self._compliant: NDArray[np.intp] | None = None
        self._torquing: NDArray[np.intp] | None = None
        self._overload = np.zeros(count)
        self._deadline = np.full(count, np.inf)
        self._forgotten = np.zeros(count, dtype=bool)
        self._exerted = np.zeros(count)  # the torques commanded in the last step
        self._planned: list[tuple[int, int, ControlMode]] = []
        for axis in range(count):
            self._configure(axis)
        for axis, torque in enumerate(self.gravity().tolist()):
            self.controllers.set_integral(axis, torque)
        self._ctrl[:] = self.controllers.integral  # so that the robot is held before the first step, too

    def reset(self) -> None:
        """Reset all states and settings; the physics have been reset to home."""
        self._set_up_drives()
        self._set_up_controllers()
        self._begin()
        self._prepare()

    # One millisecond ---------------------------------------------------------------------------------------------

    def step(self) -> None:
        """Measure, control and drive, between the two halves of a step of the physics engine.

        The other part of a step is in :class:`JointControllers`.
        """
        if self._measured_tick != self.tick:
            self.measure()
        self.controllers.step(self.tick, self.setpoints, self._ticks, self._measured_speed)
        if self._special:
            self._correct()
        if self.motor_faults or self.plant_faults or self._driven is not None:
            self._disturb()
        self.tick += 1
        if not self.tick % SLOW:
            self._supervise()

    def _correct(self) -> None:
        """Add the parts of the torques that only some modes and settings need."""
        torque = self.controllers.torque
        if self._compliant is not None:
            axes = self._compliant
            torque[axes] += self.gravity()[axes]
        if self._torquing is not None:
            # The measurement shows the torque of the previous step.
            axes = self._torquing
            missing = self._exerted[axes] - self.measured_torques()[axes]
            self.controllers.add_to_integral(axes, _TORQUE_INTEGRAL * TIMESTEP * missing)
            self._exerted[axes] = np.where(self._forgotten[axes], 0.0, self.torques[axes])
        if self._stiction:
            up = np.array([pid.stiction_up for pid in self.pids])
            down = np.array([pid.stiction_down for pid in self.pids])
            errors, controlled = self.controllers.errors, self.controllers.kp_kd[0] > 0
            torque += np.where(errors > 0, up, np.where(errors < 0, down, 0.0)) * controlled * self.newton_metres
        if self._limited:
            self.controllers.limit_torque()

    def _disturb(self) -> None:
        """Apply the faults of motors and mechanics to the torques."""
        now = self.now
        self._driven = None
        if self.motor_faults:
            self._driven = self._ctrl.copy()
            driven = self.output
            for fault in self.motor_faults:
                fault(driven, now)
            np.multiply(driven, self.newton_metres, out=self._ctrl)
        for change in self.plant_faults:
            change(now)

    # Supervision ------------------------------------------------------------------------------------------------

    def _supervise(self) -> None:
        self.controllers.clip_integral(self._max_integral)
        currents = self.motor_currents()
        np.abs(currents, out=currents)
        overload = self._overload
        overload += 1.0
        overload *= currents > self.max_current
        currents *= currents
        currents *= self.heat
        currents += AMBIENT
        currents -= self.temperature
        currents *= SLOW * TIMESTEP / _THERMAL_TIME
        self.temperature += currents
        # Counting is faster than any().
        if np.count_nonzero(overload >= _OVERLOAD_TICKS):
            for axis in self._sound(overload >= _OVERLOAD_TICKS):
                self.fault(axis, OVERCURRENT, f"over-current: more than {self.max_current[axis]:g} A")
        if np.count_nonzero(self.temperature > self.temperature_limit):
            for axis in self._sound(self.temperature > self.temperature_limit):
                self.fault(axis, OVERHEATED, f"too hot: more than {self.temperature_limit[axis]:g} degrees")
        if np.count_nonzero(self._deadline < self.now):
            for axis in np.flatnonzero(self._deadline < self.now).tolist():
                self._forget(axis)
        if np.count_nonzero(self.pid_error_limits):
            self._check_errors()
        while self._planned and self._planned[0][0] <= self.tick:
            _, axis, mode = self._planned.pop(0)
            if self.mode[axis] == _BEFORE[mode]:  # otherwise a fault occurred meanwhile
                self._enter(axis, mode)

    def _sound(self, chosen: NDArray[np.bool_]) -> list[int]:
        """Return those of the chosen axes that are not in fault yet."""
        found: list[int] = np.flatnonzero(chosen & (self.mode != ControlMode.HARDWARE_FAULT)).tolist()
        return found

    def _check_errors(self) -> None:
        limits = self.pid_error_limits
        beyond = (limits > 0) & (np.abs(self.error) > limits) & (self.controllers.kp_kd[0] > 0)
        for axis in np.flatnonzero(beyond).tolist():
            self.fault(axis, ERROR_LIMIT, f"the position is more than {self.pid_error_limits[axis]:g} degrees off")

    def _forget(self, axis: int) -> None:
        """Handle an expired command of an axis. The last command can still be read."""
        self._deadline[axis] = np.inf
        self._forgotten[axis] = True
        if ControlMode(int(self.mode[axis])) in VELOCITY_MODES:
            self.setpoints.run(np.array([axis]), np.zeros(1), np.array([STOPPING * self.degree[axis]]), self.tick)
        self._configure(axis)
        if self.mode[axis] == ControlMode.TORQUE:
            self.controllers.set_integral(axis, 0.0)
        self._refresh_duties()

    def fault(self, axis: int, code: int, message: str) -> None:
        """Put an axis into hardware fault; only a forced idle ends it."""
        self.faults[axis] = (code, f"{self.axes[axis].name}: {message}")
        self._overload[axis] = 0
        self._enter(axis, ControlMode.HARDWARE_FAULT)

    # Modes -------------------------------------------------------------------------------------------------------

    def request_mode(self, axis: int, wanted: int) -> None:
        """Change the mode by the transition table. Raises RefusedError for a mode that must not be requested."""
        state = ControlMode(int(self.mode[axis]))
        for broken in self.mode_faults:
            forced = broken(axis, state, wanted)
            if forced is not None:
                self._enter(axis, forced)
                return
        result, after = answer(state, wanted)
        if result is Answer.REFUSED:
            raise RefusedError(f"{self.axes[axis].name}: {mode_word(wanted)} is not a mode that may be requested")
        if result is Answer.TAKEN and after is not state:
            self._enter(axis, after)

    def request_interaction(self, axis: int, wanted: int) -> None:
        """Make an axis stiff or compliant; the mode stays. Raises RefusedError where there is no torque sensing."""
        if wanted not in (InteractionMode.STIFF, InteractionMode.COMPLIANT):
            raise RefusedError(f"{self.axes[axis].name}: {wanted} is no interaction mode that may be requested")
        if wanted == InteractionMode.COMPLIANT and not self.torque_controlled[axis]:
            raise RefusedError(f"{self.axes[axis].name} cannot be compliant: it has no torque control")
        if wanted != self.interaction[axis]:
            held = float(self.output[axis] * self.newton_metres[axis])
            self.interaction[axis] = wanted
            self._configure(axis)
            self._take_over(axis, held)

    def _take_over(self, axis: int, held: float) -> None:
        """Hand over to another controller with the same torque and no position error: bumpless transfer."""
        axes = np.array([axis])
        here = self.position[axes]
        setpoint, speed, _ = self.setpoints.at(self.tick, axes)
        if not self.controllers.ki[axis]:
            return
        if not speed[0]:
            self.setpoints.hold(axes, here, self.tick)
            self.direct[axis] = here[0]
            setpoint = here
        gain = float(self.controllers.kp_kd[0, axis] * self.resolution[axis])
        self.controllers.set_integral(
            axis, held - float(self.controllers.bias[axis]) - gain * float(setpoint[0] - here[0])
        )

    def _enter(self, axis: int, mode: ControlMode) -> None:
        axes = np.array([axis])
        before = ControlMode(int(self.mode[axis]))
        here = self.position[axes]
        self.setpoints.hold(axes, here, self.tick)
        self.targets[axis] = self.direct[axis] = here[0]
        self.velocities[axis] = 0.0
        self._forgotten[axis] = False
        self._deadline[axis] = np.inf
        # A held joint stays held: the next controller starts with the output of the last one.
        held = 0.0 if before in POWERLESS or mode in _DRIVEN else float(self.output[axis] * self.newton_metres[axis])
        if mode is ControlMode.TORQUE:
            self.torques[axis] = self._exerted[axis] = 0.0 if before in POWERLESS else self.measured_torques()[axis]
        elif mode is ControlMode.CURRENT:
            self.currents[axis] = 0.0 if before in POWERLESS else self.motor_currents()[axis]
        elif mode is ControlMode.PWM:
            self.duties[axis] = 0.0
        self.mode[axis] = mode
        self._configure(axis)
        self.controllers.set_integral(axis, held if self.controllers.ki[axis] else 0.0)
        self._refresh_duties()

    def calibrate(self, axis: int) -> None:
        """Calibrate an axis: it takes half a second, in which it takes no commands. RefusedError for one in fault."""
        if self.mode[axis] == ControlMode.HARDWARE_FAULT:
            raise RefusedError(f"{self.axes[axis].name} is in fault and cannot be calibrated; force it to idle first")
        self._planned = [planned for planned in self._planned if planned[1] != axis]
        self.calibrated[axis] = False
        self._enter(axis, ControlMode.CALIBRATING)
        end = self.tick + _CALIBRATION
        self._planned.append((end, axis, ControlMode.CALIBRATION_DONE))
        self._planned.append((end + SLOW, axis, ControlMode.POSITION))
        self._planned.sort(key=lambda planned: planned[0])

    def _configure(self, axis: int) -> None:
        """Set the parameters of the controller for the mode of an axis."""
        mode = ControlMode(int(self.mode[axis]))
        pid, torque = self.pids[axis], float(self.newton_metres[axis])
        kp = kd = ki = bias = 0.0  # Nm/deg, Nm s/deg, Nm/deg/s, Nm
        limit = FULL
        if mode in POWERLESS:
            pass
        elif mode is ControlMode.TORQUE:
            bias = 0.0 if self._forgotten[axis] else float(self.torques[axis])
        elif mode is ControlMode.CURRENT:
            bias = 0.0 if self._forgotten[axis] else float(self.currents[axis] / self.amperes[axis]) * torque
        elif mode is ControlMode.PWM:
            bias, limit = self._duty_of_joint(axis) * torque, float(self.duty_limit[axis])
        elif not self.pid_enabled[axis]:
            pass
        elif self.interaction[axis] == InteractionMode.COMPLIANT:
            kp, kd, bias = float(self.stiffness[axis]), float(self.damping[axis]), float(self.impedance_offset[axis])
        else:
            kp, kd, ki, bias = (number * torque for number in (pid.kp, pid.kd, pid.ki, pid.offset))
            limit = min(abs(pid.max_output), float(self.duty_limit[axis]))
        if mode is ControlMode.CALIBRATION_DONE:
            self.calibrated[axis] = True
        self._max_integral[axis] = (_TORQUE_TRIM if mode is ControlMode.TORQUE else abs(pid.max_integral)) * torque
        self._put(axis, kp, kd, ki, bias, limit * torque)
        self._note_special_axes()

    def _put(self, axis: int, kp: float, kd: float, ki: float, bias: float, limit: float) -> None:
        """Set the parameters of a controller, converted to its units."""
        controllers, ticks = self.controllers, float(self.resolution[axis])
        controllers.kp_kd[:, axis] = kp / ticks, kd * float(self.scale[axis])
        controllers.ki[axis] = ki / ticks * TIMESTEP * INTEGRATION
        controllers.set_bias(axis, bias)
        controllers.limit[axis] = limit
        if not ki and self.mode[axis] != ControlMode.TORQUE:
            controllers.set_integral(axis, 0.0)

    def _note_special_axes(self) -> None:
        # Also with damping alone: gravity is compensated, so a joint without stiffness floats.
        compliant = (self.interaction == InteractionMode.COMPLIANT) & (self.controllers.kp_kd > 0).any(axis=0)
        torquing = self.mode == ControlMode.TORQUE
        self._compliant = np.flatnonzero(compliant) if compliant.any() else None
        self._torquing = np.flatnonzero(torquing) if torquing.any() else None
        self._stiction = any(pid.stiction_up or pid.stiction_down for pid in self.pids)
        self._limited = bool((self.controllers.limit < FULL * self.newton_metres).any())
        self._special = self._limited or self._stiction or bool(compliant.any() or torquing.any())

    def _duty_of_joint(self, axis: int) -> float:
        """Set the torques of joints whose motors are driven directly; coupled joints sum those of several motors."""
        driven = self.mode == ControlMode.PWM
        return float(self._drive[axis] @ np.where(driven & ~self._forgotten, self.duties, 0.0))

    def _refresh_duties(self) -> None:
        """Update after a change of a duty cycle, or of the set of axes driven by one."""
        driven = self.mode == ControlMode.PWM
        if driven.any():
            torques = (self._drive @ np.where(driven & ~self._forgotten, self.duties, 0.0)) * self.newton_metres
            for axis in np.flatnonzero(driven).tolist():
                self.controllers.set_bias(axis, float(torques[axis]))

    # Commands: axes as arrays of numbers, values of the same length ---------------------------------------------

    def accept(self, what: str, axes: list[int], modes: frozenset[ControlMode]) -> list[int]:
        """Return the places of the axes that are in one of the modes; commands to the others are ignored."""
        now = self.now
        return [
            place
            for place, axis in enumerate(axes)
            if (int(self.mode[axis]) in modes or self._obeys_all(axis))
            and not any(lost(what, axis, now) for lost in self.command_faults)
        ]

    def _obeys_all(self, axis: int) -> bool:
        """Return whether a fault makes an axis accept the commands of all modes while its position is controlled."""
        return int(self.mode[axis]) in HOLDING_MODES and any(obeys(axis) for obeys in self.obeying_faults)

    def move(self, axes: NDArray[np.intp], targets: FloatArray) -> None:
        """Move along a trajectory; targets are clipped to the limits."""
        targets = self.setpoints.within_limits(axes, targets)
        self.targets[axes] = targets
        self.setpoints.move(axes, targets, self.speeds[axes], self.tick)
        self._deadline[axes] = np.inf

    def run(self, axes: NDArray[np.intp], velocities: FloatArray, accelerations: FloatArray) -> None:
        """Move at velocities, until the limits or the watchdog."""
        velocities = np.clip(velocities, -self.max_velocity[axes], self.max_velocity[axes])
        self.velocities[axes] = velocities
        self.setpoints.run(axes, velocities, accelerations, self.tick)
        self._watch(axes)

    def follow(self, axes: NDArray[np.intp], positions: FloatArray) -> None:
        """Set direct positions, clipped to the limits."""
        positions = self.setpoints.within_limits(axes, positions)
        self.direct[axes] = positions
        self.setpoints.hold(axes, positions, self.tick)

    def exert(self, axes: NDArray[np.intp], torques: FloatArray) -> None:
        """Exert torques."""
        most = FULL * self.newton_metres[axes]
        self.torques[axes] = np.clip(torques, -most, most)
        for axis in axes.tolist():
            self.controllers.set_bias(axis, float(self.torques[axis]))
        self._watch(axes)

    def drive_currents(self, axes: NDArray[np.intp], currents: FloatArray) -> None:
        """Drive currents."""
        self.currents[axes] = np.clip(currents, -self.peak_current[axes], self.peak_current[axes])
        for axis in axes.tolist():
            self.controllers.set_bias(axis, float(self.currents[axis] / self.amperes[axis] * self.newton_metres[axis]))
        self._watch(axes)

    def drive(self, axes: NDArray[np.intp], duties: FloatArray) -> None:
        """Drive motors with duty cycles."""
        self.duties[axes] = np.clip(duties, -self.duty_limit[axes], self.duty_limit[axes])
        self._watch(axes)
        self._refresh_duties()

    def stop(self, axes: NDArray[np.intp]) -> None:
        """Slow down to rest; the positions of rest become the targets."""
        self.velocities[axes] = 0.0
        self.setpoints.run(axes, np.zeros(len(axes)), STOPPING * self.degree[axes], self.tick)
        self.targets[axes] = self.setpoints.at(self.tick + _AT_REST, axes)[0]
        self._deadline[axes] = np.inf

    def _watch(self, axes: NDArray[np.intp]) -> None:
        self._deadline[axes] = self.now + WATCHDOG
        self._forgotten[axes] = False

    # Settings ----------------------------------------------------------------------------------------------------

    def set_pid(self, axis: int, pid: Pid) -> None:
        """Set gains; they apply at once."""
        self.pids[axis] = pid
        self._configure(axis)

    def refresh(self, axis: int) -> None:
        """Apply a setting of an axis that another module has changed."""
        self._configure(axis)
        slack = float(self.limit_slack[axis])
        self.setpoints.set_limits(axis, float(self.minimum[axis]) - slack, float(self.maximum[axis]) + slack, self.tick)

    def set_max_current(self, axis: int, current: float) -> None:
        """Set the current at which an axis goes into fault; at 0 A it does so at once."""
        self.max_current[axis] = current
        if current <= 0.0 and ControlMode(int(self.mode[axis])) is not ControlMode.HARDWARE_FAULT:
            self.fault(axis, OVERCURRENT, f"over-current: more than {current:g} A")


OVERCURRENT, OVERHEATED, ERROR_LIMIT, BROKEN = 1, 2, 3, 4
_DRIVEN = frozenset({ControlMode.TORQUE, ControlMode.CURRENT, ControlMode.PWM})
_TORQUE_INTEGRAL = 5.0  # 1/s
_TORQUE_TRIM = 50.0  # per cent
_CALIBRATION = 500  # steps
_AT_REST = 100_000  # steps after which what was stopped has come to rest
#: Modes that the board changes by itself, and from which.
_BEFORE = {
    ControlMode.CALIBRATION_DONE: ControlMode.CALIBRATING,
    ControlMode.POSITION: ControlMode.CALIBRATION_DONE,
}
