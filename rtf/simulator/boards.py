"""The motor boards of all parts together: control of 53 motors at 1 kHz, in the modes and with the setpoints of boards.

All arrays have a column for each axis, in the order of the robot's axes, in degrees and per cent of duty cycle. The
controller of the modes is in :mod:`rtf.simulator.controller`. Faults are small functions in lists, which are empty in a
healthy robot.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.bottle import Property
from rtf.robot.control_modes import HOLDING_MODES, POWERLESS, ControlMode, InteractionMode
from rtf.robot.extended_state import Field
from rtf.simulator.board_state import AMBIENT, BoardState
from rtf.simulator.controller import INTEGRATION
from rtf.simulator.plant import TIMESTEP
from rtf.simulator.position_gains import FULL
from rtf.simulator.torque_sensors import SAMPLED

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.devices.board_driver import Setpoints
    from rtf.robot.interfaces import FloatArray, Pid
    from rtf.simulator.plant import Plant

#: Steps between the slow work of the boards: supervision, temperatures, torque sensors.
SLOW = SAMPLED
_THERMAL_TIME = 600.0  # s


class Boards(BoardState):
    """The motor boards. Not thread-safe: used by the simulation's loop, or by a command between two steps."""

    def __init__(self, plant: Plant, data: Any, seed: int = 0) -> None:
        super().__init__(plant, data, seed)
        self._prepare()

    def _prepare(self) -> None:
        """Set the state of the robot after power-up: held at home."""
        self.set_up(self.connect(Property()), self.couplings)
        count = self.count
        self._max_integral = np.zeros(count)  # Nm
        self._limited = False
        self._stiction = self._special = False
        self._compliant: NDArray[np.intp] | None = None
        self._torquing: NDArray[np.intp] | None = None
        self._exerted = np.zeros(count)  # the torques commanded in the last step
        #: The torques commanded when the torque sensors were read; the first ones belong to what they show now.
        self._commanded: deque[FloatArray] = deque([np.zeros(count)], maxlen=self.torque_sensors.kept)
        for axis in range(count):
            self._control(axis)
        self.motors.refresh()
        self._note_special_axes()
        for axis, torque in enumerate(self.gravity().tolist()):
            self.controllers.set_integral(axis, torque)
        held = self.controllers.integral
        self.motors.rest(held)  # so that the robot is held before the first step, too
        self.torque_sensors.rest(held)
        self.counts.fill(self._ticks, self.motors.gears.angles())

    def reset(self) -> None:
        """Reset all states and settings; the physics have been reset to home."""
        self._prepare()

    # One millisecond ---------------------------------------------------------------------------------------------

    def step(self) -> None:
        """Measure, control and drive, between the two halves of a step of the physics engine.

        The other part of a step is in :class:`JointControllers`.
        """
        if self._measured_tick != self.tick:
            self.measure()
        self.controllers.step(self.tick, self.trajectories, self._ticks, self._measured_speed)
        if self._special:
            self._correct()
        self.motors.step(self.tick)
        for run in self.each_step:
            run(self.now)
        self.tick += 1
        if not self.tick % SLOW:
            self.supervise()

    def _correct(self) -> None:
        """Add the parts of the torques that only some modes and settings need."""
        torque = self.controllers.torque
        if self._compliant is not None:
            axes = self._compliant
            torque[axes] += self.gravity()[axes]
        if self._torquing is not None:
            axes = self._torquing
            missing = self._commanded[0][axes] - self.measured_torques()[axes]
            self.controllers.add_to_integral(axes, _TORQUE_INTEGRAL * TIMESTEP * missing)
            self._exerted[axes] = np.where(self._expired[axes], 0.0, self.torques[axes])
        if self._stiction:
            up = np.array([pid.stiction_up for pid in self.pids])
            down = np.array([pid.stiction_down for pid in self.pids])
            errors, controlled = self.controllers.errors, self.controllers.kp_kd[0] > 0
            torque += np.where(errors > 0, up, np.where(errors < 0, down, 0.0)) * controlled * self.newton_metres
        if self._limited:
            self.controllers.limit_torque()

    # Supervision ------------------------------------------------------------------------------------------------

    def supervise(self) -> None:
        """Check the motors, warm them, read the slow sensors, and do what all boards do."""
        self.torque_sensors.sample(self.tick)
        self._commanded.append(self._exerted.copy())
        self.controllers.clip_integral(self._max_integral)
        self._heat(self.motors.drawn())
        self.check_motors(self.motor_currents(), self.temperature)
        super().supervise()

    def _heat(self, currents: FloatArray) -> None:
        change = currents * currents
        change *= self.heat
        change += AMBIENT
        change -= self.temperature
        change *= SLOW * TIMESTEP / _THERMAL_TIME
        self.temperature += change

    def controller_errors(self) -> FloatArray:
        return np.where(self.controllers.kp_kd[0] > 0, self.error, 0.0)

    def _expire(self, axis: int) -> None:
        super()._expire(axis)
        if self.mode[axis] == ControlMode.TORQUE:
            self.controllers.set_integral(axis, 0.0)

    # Modes -------------------------------------------------------------------------------------------------------

    def request_mode(self, axis: int, wanted: int) -> None:
        state = ControlMode(int(self.mode[axis]))
        for broken in self.mode_faults:
            forced = broken(axis, state, wanted)
            if forced is not None:
                self.enter(axis, forced)
                return
        super().request_mode(axis, wanted)

    def shown_modes(self) -> NDArray[np.int32]:
        if not self.shown_mode_faults:
            return self.modes
        shown = self.modes.copy()
        for fault in self.shown_mode_faults:
            fault(shown[0], self.now)
        return shown

    def request_interaction(self, axis: int, wanted: int) -> None:
        before, held = self.interaction[axis], float(self.output[axis] * self.newton_metres[axis])
        super().request_interaction(axis, wanted)
        if wanted != before:
            self._take_over(axis, held)

    def _take_over(self, axis: int, held: float) -> None:
        """Hand over to another controller with the same torque and no position error: bumpless transfer."""
        axes = np.array([axis])
        here = self.position[axes]
        setpoint, speed, _ = self.trajectories.at(self.tick, axes)
        if not self.controllers.ki[axis]:
            return
        if not speed[0]:
            self.trajectories.hold(axes, here, self.tick)
            self.direct[axis] = here[0]
            setpoint = here
        gain = float(self.controllers.kp_kd[0, axis] * self.resolution[axis])
        self.controllers.set_integral(
            axis, held - float(self.controllers.bias[axis]) - gain * float(setpoint[0] - here[0])
        )

    def enter(self, axis: int, mode: ControlMode) -> None:
        before = ControlMode(int(self.mode[axis]))
        # A held joint stays held: the next controller starts with the output of the last one.
        held = 0.0 if before in POWERLESS or mode in _DRIVEN else float(self.output[axis] * self.newton_metres[axis])
        super().enter(axis, mode)
        if mode is ControlMode.TORQUE:
            self._exerted[axis] = self.torques[axis]
            for commanded, measured in zip(self._commanded, self.torque_sensors.samples, strict=True):
                commanded[axis] = measured[axis]  # what was before is no error of this controller
        self.controllers.set_integral(axis, held if self.controllers.ki[axis] else 0.0)

    def _effort(self, axis: int, before: ControlMode, field: Field) -> float:
        """Return the present torque, or the current without the noise of its sensor."""
        if field is Field.CURRENTS and before not in POWERLESS:
            return float(self.motors.current[axis])
        return super()._effort(axis, before, field)

    def configure(self, axis: int) -> None:
        if self._control(axis):
            self.motors.refresh()
        self._note_special_axes()

    def _control(self, axis: int) -> bool:
        """Set the controller and the amplifier of an axis; return whether its motor is fed otherwise than before."""
        mode = ControlMode(int(self.mode[axis]))
        pid, torque = self.pids[axis], float(self.newton_metres[axis])
        kp = kd = ki = bias = ahead = 0.0  # Nm/deg, Nm s/deg, Nm/deg/s, Nm, Nm s/deg
        limit, voltage = FULL, False
        if mode in POWERLESS:
            pass
        elif mode is ControlMode.TORQUE:
            bias = 0.0 if self._expired[axis] else float(self.torques[axis])
        elif mode is ControlMode.CURRENT:
            bias = self._torque_by_motors(axis, mode, self.currents)
        elif mode is ControlMode.PWM:
            bias, voltage = self._torque_by_motors(axis, mode, self.motors.blocked_currents(self.duties)), True
        elif not self.pid_enabled[axis]:
            pass
        elif self.interaction[axis] == InteractionMode.COMPLIANT:
            kp, kd, bias = float(self.stiffness[axis]), float(self.damping[axis]), float(self.impedance_offset[axis])
        else:
            gains = pid.kp, pid.kd, pid.ki, pid.offset, pid.feedforward
            kp, kd, ki, bias, ahead = (number * torque for number in gains)
            limit, voltage = abs(pid.max_output), bool(self.motors.by_voltage[axis])
        self._max_integral[axis] = (_TORQUE_TRIM if mode is ControlMode.TORQUE else abs(pid.max_integral)) * torque
        self._put(axis, (kp, kd, ki, bias, ahead), limit * torque)
        return self.motors.feed(
            axis, voltage=voltage, duty=float(self.duty_limit[axis]), peak=abs(float(self.peak_current[axis]))
        )

    def _put(self, axis: int, parameters: tuple[float, float, float, float, float], limit: float) -> None:
        """Set the parameters of a controller, converted to its units: kp, kd, ki, bias and feedforward."""
        kp, kd, ki, bias, ahead = parameters
        if ahead:
            kd = max(kd, _LEAST_SHARE * abs(ahead))  # as the feedforward is a share of it
        controllers, ticks = self.controllers, float(self.resolution[axis])
        controllers.kp_kd[:, axis] = kp / ticks, kd * float(self.scale[axis])
        controllers.ki[axis] = ki / ticks * TIMESTEP * INTEGRATION
        controllers.set_bias(axis, bias)
        self.trajectories.lead(axis, 1.0 + ahead / kd if ahead else 1.0, self.tick)
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

    def _torque_by_motors(self, axis: int, mode: ControlMode, currents: FloatArray) -> float:
        """Return the torque of a joint by the motors that are driven directly, of which coupled joints have several."""
        driven = self.mode == mode
        return float(self.motors.torques_of(np.where(driven & ~self._expired, currents, 0.0))[axis])

    def write(self, setpoints: Setpoints, modes: NDArray[np.int32]) -> None:
        """Set the efforts of the controllers, which follow the positions by themselves."""
        for axis in np.flatnonzero(modes == ControlMode.TORQUE).tolist():
            self.controllers.set_bias(axis, float(setpoints.torques[axis]))
        for mode in (ControlMode.PWM, ControlMode.CURRENT):
            driven = modes == mode
            if driven.any():
                blocked = mode is ControlMode.PWM
                currents = self.motors.blocked_currents(setpoints.duty_cycles) if blocked else setpoints.currents
                torques = self.motors.torques_of(np.where(driven, currents, 0.0))
                for axis in np.flatnonzero(driven).tolist():
                    self.controllers.set_bias(axis, float(torques[axis]))

    def accept(self, what: str, axes: list[int], modes: frozenset[ControlMode]) -> list[int]:
        """Return the places of the axes that accept a command; faults can lose commands, or accept more."""
        now = self.now
        return [
            place
            for place, axis in enumerate(axes)
            if (int(self.mode[axis]) in modes or self._obeys_all(axis))
            and not any(lost(what, axis, now) for lost in self.command_faults)
        ]

    def move_speeds(self) -> FloatArray:
        speeds: FloatArray = self.speeds * self.speed_factors
        return speeds

    def _obeys_all(self, axis: int) -> bool:
        """Return whether a fault makes an axis accept the commands of all modes while its position is controlled."""
        return int(self.mode[axis]) in HOLDING_MODES and any(obeys(axis) for obeys in self.obeying_faults)

    # Settings ----------------------------------------------------------------------------------------------------

    def set_pid(self, axis: int, pid: Pid) -> None:
        """Set the gains of a position controller; they apply at once."""
        self.pids[axis] = pid
        self.configure(axis)

    def reset_controller(self, axis: int) -> None:
        self.controllers.set_integral(axis, 0.0)

    def refresh(self, axis: int) -> None:
        self.configure(axis)
        slack, minimum, maximum = self.limit_slack[axis], self.minimum[axis], self.maximum[axis]
        self.trajectories.set_limits(axis, float(minimum - slack), float(maximum + slack), self.tick)


_DRIVEN = frozenset({ControlMode.TORQUE, ControlMode.CURRENT, ControlMode.PWM})
_TORQUE_INTEGRAL = 5.0  # 1/s
_LEAST_SHARE = 1e-6
_TORQUE_TRIM = 50.0  # per cent
