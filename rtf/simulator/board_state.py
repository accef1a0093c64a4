"""The state of the motor boards: configuration, last commands and measurements.

All arrays have a column for each axis, in the order of :attr:`rtf.robot.model.RobotModel.axes`, in degrees for revolute
axes and metres for prismatic ones. The behaviour of the boards is in :mod:`rtf.simulator.boards`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.simulator.controller import JointControllers
from rtf.simulator.plant import TIMESTEP
from rtf.simulator.position_gains import FULL, position_pids
from rtf.simulator.setpoints import Setpoints

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rtf.robot.interfaces import CalibrationParameters, FloatArray, MotorTorqueParameters, Pid, PidType
    from rtf.robot.model import Axis
    from rtf.simulator.plant import Plant

AMBIENT = 25.0  # °C
_HEATING = 40.0  # °C above ambient after a long time at nominal current
_TOO_HOT = 90.0
STEPS_A_SECOND = round(1 / TIMESTEP)
_DEGREES = 180.0 / math.pi
_TURN = 360.0
#: What is a degree of a revolute axis in the defaults of speeds is this of a prismatic one (m).
SLIDE = 0.005


class BoardState:
    """The state of all boards. ``data`` is the state of the physics engine."""

    def __init__(self, plant: Plant, data: Any) -> None:
        self.plant = plant
        self.axes: tuple[Axis, ...] = plant.robot.axes
        self.data = data
        self.count = len(self.axes)
        self.tick = 0
        prismatic = np.array([axis.prismatic for axis in self.axes])
        #: Units of each axis, deg or m, a unit of the physics engine, rad or m.
        self.scale = np.where(prismatic, 1.0, _DEGREES)
        self.per_scale = 1.0 / self.scale
        #: The units of each axis in place of a degree, in the defaults of speeds.
        self.degree = np.where(prismatic, SLIDE, 1.0)
        self._length: FloatArray = data.actuator_length
        self._speed: FloatArray = data.actuator_velocity
        self._ctrl: FloatArray = data.ctrl
        self._exerts: FloatArray = data.actuator_force
        self._hastens: FloatArray = data.qacc
        self._jacobian = plant.jacobian
        self._set_up_drives()
        self._set_up_controllers()
        self._begin()
        # Active faults: functions that change their arguments. Empty in a healthy robot.
        self.encoder_faults: list[Callable[[FloatArray, FloatArray, float], None]] = []
        self.motor_encoder_faults: list[Callable[[FloatArray, FloatArray, float], None]] = []
        self.motor_faults: list[Callable[[FloatArray, float], None]] = []
        self.current_faults: list[Callable[[FloatArray, float], None]] = []
        self.torque_faults: list[Callable[[FloatArray, float], None]] = []
        self.plant_faults: list[Callable[[float], None]] = []
        self.command_faults: list[Callable[[str, int, float], bool]] = []
        self.obeying_faults: list[Callable[[int], bool]] = []
        self.mode_faults: list[Callable[[int, ControlMode, int], ControlMode | None]] = []

    @property
    def now(self) -> float:
        """Seconds since the beginning."""
        return self.tick / STEPS_A_SECOND

    def column(self, name: str) -> FloatArray:
        """Return one number of each axis."""
        return np.array([getattr(axis, name) for axis in self.axes], dtype=np.float64)

    def _set_up_drives(self) -> None:
        """Initialize motors, gears, encoders and amplifiers."""
        count = self.count
        self.newton_metres = self.column("max_torque") / FULL  # a per cent of duty cycle
        self.amperes = self.column("peak_current") / FULL  # likewise
        self.gearbox = self.column("gearbox")  # as built; the configuration of the boards is in ``configured_gearbox``
        self.joint_to_motor = self.plant.robot.joint_to_motor.copy()
        self.configured_gearbox = self.gearbox.copy()
        self.configured_couplings = self.joint_to_motor.copy()
        #: Degrees of each rotor a radian, or a metre, of each joint.
        self._turns = self.gearbox[:, None] * self.joint_to_motor * np.where(self.scale == 1.0, _TURN, _DEGREES)
        #: Factors from duty cycles of motors to those of joints, and back.
        self._drive = (np.sign(self.gearbox)[:, None] * self.joint_to_motor).T
        self._undrive = np.linalg.inv(self._drive)
        self.resolution = self.column("encoder_resolution")
        self._ticks_a_radian = self.resolution * self.scale
        self.rotor_resolution = self.column("rotor_resolution")
        self._rotor_ticks = self.rotor_resolution / _TURN  # a degree
        self.nominal_current, self.peak_current = self.column("nominal_current"), self.column("peak_current")
        self.max_current = self.column("overload_current")
        self.duty_limit = np.full(count, FULL)
        self.temperature = np.full(count, AMBIENT)
        self.temperature_limit = np.full(count, _TOO_HOT)
        self.heat = _HEATING / self.nominal_current**2
        self.torque_parameters: dict[int, MotorTorqueParameters] = {}
        self.torque_controlled = np.array([axis.torque_control for axis in self.axes])

    def _set_up_controllers(self) -> None:
        """Initialize limits and gains."""
        count = self.count
        self.minimum, self.maximum = self.column("minimum"), self.column("maximum")
        self.limit_slack = np.zeros(count)  # how far a faulty board lets joints go beyond them
        self.min_velocity, self.max_velocity = np.zeros(count), self.column("max_velocity")
        self.speeds = 10.0 * self.degree
        self.accelerations = 1000.0 * self.degree
        self.pids: list[Pid] = position_pids(self.axes, self.plant.axis_inertia(self.data))
        # The last settings of controllers that are not simulated.
        self.other_pids: dict[tuple[PidType, int], Pid] = {}
        self.other_enabled: dict[tuple[PidType, int], bool] = {}
        self.other_error_limits: dict[tuple[PidType, int], float] = {}
        self.pid_enabled = np.ones(count, dtype=bool)
        self.pid_error_limits = np.zeros(count)
        self.default_stiffness, self.default_damping = _default_impedance(self.pids, self.newton_metres)
        self.stiffness, self.damping = self.default_stiffness.copy(), self.default_damping.copy()
        self.impedance_offset = np.zeros(count)
        self.calibration: dict[int, CalibrationParameters] = {}

    def _begin(self) -> None:
        """Initialize the state after power-up: at home, in position mode, calibrated."""
        count, home = self.count, self.plant.home_axes * self.scale
        self.modes = np.empty((2, count), dtype=np.int32)
        self.mode, self.interaction = self.modes
        self.mode[:], self.interaction[:] = ControlMode.POSITION, InteractionMode.STIFF
        self.calibrated = np.ones(count, dtype=bool)
        self.faults: list[tuple[int, str]] = [(0, "")] * count
        self.setpoints = Setpoints(
            home, self.minimum, self.maximum, TIMESTEP, begin=self.tick, scales=(self.resolution, self.per_scale)
        )
        self.targets, self.direct = home.copy(), home.copy()
        self.velocities, self.torques, self.currents = np.zeros(count), np.zeros(count), np.zeros(count)
        self.duties = np.zeros(count)  # of motors
        self.controllers = JointControllers(self._ctrl)
        self._ticks = np.rint(home * self.resolution)
        self._measured_speed = self._speed  # rad/s; those of the physics engine, unless an encoder is faulty
        self._driven: FloatArray | None = None  # the torques that the boards commanded, where motors gave others
        self._encoder_shift: FloatArray | None = None
        self._motor_shift = np.zeros(count)
        self._scratch = np.empty(count)
        self._snapshot = np.zeros((9, count))
        self._snapshot_tick = self._measured_tick = -1

    # Measurements ------------------------------------------------------------------------------------------------

    def measure(self) -> None:
        """Read the encoders. To be called once a step, so that an encoder fault is applied once."""
        if self._measured_tick == self.tick:
            return
        self._measured_tick = self.tick
        np.multiply(self._length, self._ticks_a_radian, out=self._scratch)
        np.rint(self._scratch, out=self._ticks)
        if self._encoder_shift is not None or self.encoder_faults:
            self._distort()
        else:
            self._measured_speed = self._speed

    def _distort(self) -> None:
        """Apply encoder offsets and encoder faults to the measurements."""
        position, velocity = self._ticks / self.resolution, self._speed * self.scale
        if self._encoder_shift is not None:
            position += self._encoder_shift
        for fault in self.encoder_faults:
            fault(position, velocity, self.now)
        self._ticks[:] = np.rint(position * self.resolution)
        self._measured_speed = velocity / self.scale

    @property
    def position(self) -> FloatArray:
        """The encoder readings (deg)."""
        return self._ticks / self.resolution

    @property
    def velocity(self) -> FloatArray:
        """The speeds by the encoders (deg/s)."""
        return self._measured_speed * self.scale

    @property
    def error(self) -> FloatArray:
        """Reference minus position, at the last step (deg)."""
        return self.controllers.errors / self.resolution

    @property
    def output(self) -> FloatArray:
        """The outputs of the controllers (per cent of duty cycle, of the joint)."""
        torque = self._ctrl if self._driven is None else self._driven
        output: FloatArray = torque / self.newton_metres
        np.minimum(output, FULL, out=output)  # twice as quick as clip
        return np.maximum(output, -FULL, out=output)

    def gravity(self) -> FloatArray:
        """The torque that holds each axis against gravity and against the motion of the others (Nm)."""
        return self.plant.axis_torques(self.data.qfrc_bias)

    def accelerations_now(self) -> FloatArray:
        """The accelerations of the axes (deg/s²)."""
        found: FloatArray = self._jacobian @ self._hastens
        found *= self.scale
        return found

    def measured_torques(self) -> FloatArray:
        """The readings of the torque sensors (Nm)."""
        torques: FloatArray = self._exerts.copy()
        for fault in self.torque_faults:
            fault(torques, self.now)
        return torques

    def motor_currents(self) -> FloatArray:
        """The currents of the motors (A), with the sign of the torque of the joint."""
        currents = self.output * self.amperes
        for fault in self.current_faults:
            fault(currents, self.now)
        return currents

    def motor_duties(self) -> FloatArray:
        """The duty cycles of the motors (per cent)."""
        duties: FloatArray = self._undrive @ self.output
        return duties

    def motor_motion(self) -> tuple[FloatArray, FloatArray]:
        """Angles of the rotors (deg), as their encoders count them, and their speeds (deg/s)."""
        turns = self._turns @ self._length
        speeds = self._turns @ self._speed
        for fault in self.motor_encoder_faults:
            fault(turns, speeds, self.now)
        ticks = self._rotor_ticks
        turns += self._motor_shift
        turns *= ticks
        np.rint(turns, out=turns)
        turns /= ticks
        return turns, speeds

    def motor_accelerations(self) -> FloatArray:
        """The accelerations of the rotors (deg/s²)."""
        accelerations: FloatArray = self._turns @ (self._jacobian @ self._hastens)
        return accelerations

    def snapshot(self) -> FloatArray:
        """All current measurements, shape (9, axes), in the order of the extended state of a control board."""
        if self._snapshot_tick != self.tick:
            shot = self._snapshot
            np.divide(self._ticks, self.resolution, out=shot[0])
            np.multiply(self._measured_speed, self.scale, out=shot[1])
            hastens = self._jacobian @ self._hastens
            np.multiply(hastens, self.scale, out=shot[2])
            shot[3], shot[4] = self.motor_motion()
            np.dot(self._turns, hastens, out=shot[5])
            shot[6] = self.measured_torques()
            output = self.output
            np.dot(self._undrive, output, out=shot[7])
            output *= self.amperes
            for fault in self.current_faults:
                fault(output, self.now)
            shot[8] = output
            self._snapshot_tick = self.tick
        return self._snapshot

    def shift_encoders(self, axes: NDArray[np.intp], values: FloatArray) -> None:
        """Set the encoder readings of axes; controlled axes continue from there."""
        if self._encoder_shift is None:
            self._encoder_shift = np.zeros(self.count)
        self._encoder_shift[axes] += values - self.position[axes]
        self._measured_tick = self._snapshot_tick = -1
        self.measure()
        self.setpoints.hold(axes, values, self.tick)
        self.targets[axes] = self.direct[axes] = values

    def shift_motor_encoders(self, axes: NDArray[np.intp], values: FloatArray) -> None:
        """Set the encoder readings of rotors."""
        self._motor_shift[axes] += values - self.motor_motion()[0][axes]


def _default_impedance(pids: list[Pid], newton_metres: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a tenth of the stiffness of the position loop, and its critical damping (Nm/deg, Nm s/deg)."""
    kp = np.array([pid.kp for pid in pids]) * newton_metres
    kd = np.array([pid.kd for pid in pids]) * newton_metres
    return kp / 10.0, kd / math.sqrt(10.0)
