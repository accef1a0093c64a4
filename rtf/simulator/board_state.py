"""The motors, encoders and sensors of the simulated boards, and their faults.

All arrays have a column for each axis, in the order of the robot's axes. Modes, commands and settings are in the base
class, as for all boards; the control of the motors is in :mod:`rtf.simulator.boards`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.robot.devices.board_axes import BoardAxis
from rtf.robot.devices.board_driver import BoardDriver
from rtf.robot.devices.motor_board import MotorBoard
from rtf.robot.extended_state import ExtendedState, Field
from rtf.robot.interfaces import JointType, MotorTorqueParameters
from rtf.simulator.controller import JointControllers
from rtf.simulator.encoder_counts import EncoderCounts
from rtf.simulator.fair_lock import FairLock
from rtf.simulator.motors import Motors
from rtf.simulator.plant import TIMESTEP
from rtf.simulator.position_gains import FULL, position_pids
from rtf.simulator.setpoints import SetpointBlocks
from rtf.simulator.torque_sensors import TorqueSensors

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from rtf.bottle import Property
    from rtf.robot.control_modes import ControlMode
    from rtf.robot.interfaces import FloatArray, Pid
    from rtf.robot.model import Axis
    from rtf.simulator.plant import Plant

AMBIENT = 25.0  # °C
_HEATING = 40.0  # °C above ambient after a long time at nominal current
_TOO_HOT = 90.0
#: The greatest impedance, as multiples of the default; beyond it a loop with 1 ms sampling is not stable.
_STIFFEST = 10.0
STEPS_A_SECOND = round(1 / TIMESTEP)
_DEGREES = 180.0 / math.pi
_TURN = 360.0


class BoardState(MotorBoard, BoardDriver):
    """The motors and sensors of all boards, and their driver. ``data`` is the state of the physics engine."""

    period = None
    steps_a_second = STEPS_A_SECOND
    tick: int
    lock: FairLock
    trajectories: SetpointBlocks

    def __init__(self, plant: Plant, data: Any, seed: int = 0) -> None:
        self.plant = plant
        self.axes: tuple[Axis, ...] = plant.robot.axes
        self.data = data
        self.tick = 0
        self.couplings = plant.robot.joint_to_motor.copy()
        #: Units of each axis, deg or m, a unit of the physics engine, rad or m.
        self.scale = np.array([1.0 if axis.prismatic else _DEGREES for axis in self.axes], dtype=np.float64)
        self._length: FloatArray = data.actuator_length
        self.motors = Motors(plant, data, seed)
        self.torque_sensors = TorqueSensors(plant, data.actuator_force, seed)
        super().__init__(self, FairLock())
        # Active faults: functions that change their arguments. Empty in a healthy robot.
        self.encoder_faults: list[Callable[[FloatArray, FloatArray, float], None]] = []
        self.motor_encoder_faults: list[Callable[[FloatArray, FloatArray, float], None]] = []
        self.current_faults: list[Callable[[FloatArray, float], None]] = []
        self.torque_faults: list[Callable[[FloatArray, float], None]] = []
        #: What else runs in each step, after the motors: faults of the plant, emulated boards.
        self.each_step: list[Callable[[float], None]] = []
        self.friction_faults: dict[int, dict[object, float]] = {}  # by degree of freedom: what each fault adds, Nm
        self.command_faults: list[Callable[[str, int, float], bool]] = []
        self.obeying_faults: list[Callable[[int], bool]] = []
        self.shown_mode_faults: list[Callable[[NDArray[np.int32], float], None]] = []
        self.mode_faults: list[Callable[[int, ControlMode, int], ControlMode | None]] = []

    def connect(self, configuration: Property) -> list[BoardAxis]:
        """Return the axes: the hardware is the simulation."""
        del configuration
        factors = self.plant.unit.factors("gain", 3, len(self.axes))
        return board_axes(self.axes, self.plant.inertia, self.motors.damping(), factors)

    def update(self) -> None:
        """Do nothing: the simulation keeps the state up to date."""

    def disconnect(self) -> None:
        """Do nothing: the boards live as long as the simulation."""

    def set_up(self, axes: Sequence[BoardAxis], couplings: FloatArray | None = None) -> None:
        """Initialize the boards: at home."""
        count, home = len(axes), self.plant.home_axes * self.scale
        self.resolution = np.array([axis.encoder_resolution for axis in self.axes], dtype=np.float64)
        self._home = home
        super().set_up(axes, couplings)
        self.targets[:] = self.direct[:] = home
        self.newton_metres = self.max_torque / FULL  # a per cent of a controller's output
        self.gearbox = self.configured_gearbox.copy()  # as built; that of the configuration can be wrong
        self.joint_to_motor = self.configured_couplings.copy()
        #: Degrees of each rotor a radian, or a metre, of each joint.
        self._turns = self.gearbox[:, None] * self.joint_to_motor * np.where(self.scale == 1.0, _TURN, _DEGREES)
        self._ticks_a_radian = self.resolution * self.scale
        zeros = self.plant.unit.zeros(self.axes) * self.resolution
        self._zeros = zeros if zeros.any() else None  # offsets of the encoders, ticks
        self._rotor_ticks = self.rotor_resolution / _TURN  # a degree
        self.temperature = np.full(count, AMBIENT)
        self.heat = _HEATING / self.nominal_current**2
        self.limit_slack = np.zeros(count)  # how far a faulty board lets joints go beyond them
        self.speed_factors = np.ones(count)  # of moves, as multiples of the reference speeds
        self.controllers = JointControllers(self.motors.wanted)
        self.counts = EncoderCounts(self._ticks_a_radian, self.plant.robot.sensors.encoders)
        self._ticks = np.rint(home * self.resolution)
        self._measured_speed = np.zeros(count)  # rad/s
        self.counts.fill(self._ticks, self.motors.gears.angles())
        self._encoder_shift: FloatArray | None = None
        self._motor_shift = np.zeros(count)
        self._scratch = np.empty(count)
        self.state = ExtendedState(count)
        self.state.valid.fill(True)
        self._snapshot_tick = self._measured_tick = -1

    def make_trajectories(self) -> SetpointBlocks:
        return SetpointBlocks(
            self._home,
            self.minimum,
            self.maximum,
            TIMESTEP,
            begin=self.tick,
            scales=(self.resolution, 1.0 / self.scale),
        )

    # Measurements ------------------------------------------------------------------------------------------------

    def measure(self) -> None:
        """Read the encoders. To be called once a step, so that an encoder fault is applied once."""
        if self._measured_tick == self.tick:
            return
        self._measured_tick = self.tick
        np.multiply(self._length, self._ticks_a_radian, out=self._scratch)
        if self._zeros is not None:
            self._scratch += self._zeros
        counts = self.counts
        counts.put(self.tick, self._scratch, self.motors.gears.angles())
        self._ticks, self._measured_speed = counts.shown(self.tick)
        if self._encoder_shift is not None or self.encoder_faults:
            self._distort()

    def _distort(self) -> None:
        """Apply encoder offsets and encoder faults to the measurements."""
        position, velocity = self._ticks / self.resolution, self._measured_speed * self.scale
        if self._encoder_shift is not None:
            position += self._encoder_shift
        for fault in self.encoder_faults:
            fault(position, velocity, self.now)
        self._ticks = np.rint(position * self.resolution)
        self._measured_speed = velocity / self.scale

    @property
    def position(self) -> FloatArray:
        """The encoder readings (deg)."""
        return self._ticks / self.resolution

    @property
    def velocity(self) -> FloatArray:
        """The speeds by the encoders (deg/s)."""
        velocity: FloatArray = self._measured_speed * self.scale
        return velocity

    @property
    def error(self) -> FloatArray:
        """Setpoint minus position, at the last step (deg)."""
        return self.controllers.errors / self.resolution

    @property
    def output(self) -> FloatArray:
        """The outputs of the controllers (per cent of duty cycle, of the joint)."""
        output: FloatArray = self.motors.wanted / self.newton_metres
        np.minimum(output, FULL, out=output)  # twice as quick as clip
        return np.maximum(output, -FULL, out=output)

    def controller_outputs(self) -> FloatArray:
        return self.output

    def gravity(self) -> FloatArray:
        """The torque that holds each axis against gravity and against the motion of the others (Nm)."""
        return self.plant.axis_torques(self.data.qfrc_bias)

    def accelerations_now(self) -> FloatArray:
        """The accelerations of the axes by the counts of their encoders (deg/s²)."""
        found = self.counts.accelerations(self.tick)
        found *= self.scale
        return found

    def measured_torques(self) -> FloatArray:
        """The readings of the torque sensors (Nm)."""
        torques = self.torque_sensors.torques()
        for fault in self.torque_faults:
            fault(torques, self.now)
        return torques

    def motor_currents(self) -> FloatArray:
        """The readings of the current sensors (A), with the signs of the duty cycles."""
        currents = self.motors.sensed(self.tick)
        for fault in self.current_faults:
            fault(currents, self.now)
        step = self.motors.current_step
        currents /= step
        np.rint(currents, out=currents)
        currents *= step
        return currents

    def motor_duties(self) -> FloatArray:
        """The duty cycles of the motors (per cent); 0 of those without power."""
        return self.motors.duties(self._powered)

    def motor_motion(self) -> tuple[FloatArray, FloatArray]:
        """Angles of the rotors (deg), as their encoders count them, and their speeds (deg/s)."""
        turns, ticks = self._turns @ self.motors.gears.angles(), self._rotor_ticks
        before = self._turns @ self.counts.rotors_before(self.tick)
        speeds = np.rint(turns * ticks)
        speeds -= np.rint(before * ticks)
        speeds /= ticks * self.counts.window
        for fault in self.motor_encoder_faults:
            fault(turns, speeds, self.now)
        turns += self._motor_shift
        turns *= ticks
        np.rint(turns, out=turns)
        turns /= ticks
        return turns, speeds

    def motor_accelerations(self) -> FloatArray:
        """The accelerations of the rotors (deg/s²)."""
        accelerations: FloatArray = self._turns @ self.counts.rotor_accelerations(self.tick)
        return accelerations

    def measured(self, field: Field) -> NDArray[Any]:
        return _MEASURED[field](self)

    def snapshot(self) -> ExtendedState:
        """Return all measurements of this step."""
        if self._snapshot_tick != self.tick:
            self.read(self.state)
            self._snapshot_tick = self.tick
        return self.state

    def read(self, state: ExtendedState) -> None:
        shot = state.floats
        np.divide(self._ticks, self.resolution, out=shot[0])
        np.multiply(self._measured_speed, self.scale, out=shot[1])
        shot[2] = self.accelerations_now()
        shot[3], shot[4] = self.motor_motion()
        shot[5] = self.motor_accelerations()
        shot[6] = self.measured_torques()
        shot[7] = self.motor_duties()
        shot[8] = self.motor_currents()
        state.temperatures[:] = self.temperature

    def shift_encoders(self, axes: NDArray[np.intp], values: FloatArray) -> None:
        """Set the encoder readings of axes; controlled axes continue from there."""
        if self._encoder_shift is None:
            self._encoder_shift = np.zeros(self.count)
        self._encoder_shift[axes] += values - self.position[axes]
        self.hold_as_shown(axes)

    def hold_as_shown(self, axes: NDArray[np.intp]) -> None:
        """Let the controllers of axes continue from what their encoders show, after this has jumped."""
        self._measured_tick = self._snapshot_tick = -1
        self.measure()
        self._hold(axes, self.position[axes])

    def shift_motor_encoders(self, axes: NDArray[np.intp], values: FloatArray) -> None:
        """Set the encoder readings of rotors."""
        self._motor_shift[axes] += values - self.motor_motion()[0][axes]


def board_axes(axes: Sequence[Axis], inertia: FloatArray, damping: FloatArray, factors: FloatArray) -> list[BoardAxis]:
    """Return the configuration of the boards of these axes, with gains for their inertia (kg m²).

    ``damping`` is that by their motors (Nm s/rad). ``factors`` of the gains kp, kd and ki have the shape (3, axes).
    """
    return [
        _board_axis(axis, pid._replace(kp=pid.kp * kp, kd=pid.kd * kd, ki=pid.ki * ki))
        for axis, pid, (kp, kd, ki) in zip(axes, position_pids(axes, inertia, damping), factors.T.tolist(), strict=True)
    ]


def _board_axis(axis: Axis, pid: Pid) -> BoardAxis:
    newton_metres = axis.max_torque / FULL  # a per cent of duty cycle
    # A tenth of the stiffness of the position loop, and its critical damping, that of the motor included.
    stiffness = pid.kp * newton_metres / 10.0
    damping = (pid.kd + pid.feedforward) * newton_metres / math.sqrt(10.0)
    return BoardAxis(
        name=axis.name,
        kind=JointType.PRISMATIC if axis.prismatic else JointType.REVOLUTE,
        minimum=axis.minimum,
        maximum=axis.maximum,
        max_velocity=axis.max_velocity,
        max_torque=axis.max_torque,
        gearbox=axis.gearbox,
        rotor_resolution=axis.rotor_resolution,
        nominal_current=axis.nominal_current,
        peak_current=axis.peak_current,
        max_current=axis.overload_current,
        temperature_limit=_TOO_HOT,
        supply_voltage=axis.drive.supply,
        torque_controlled=axis.torque_control,
        pid=pid,
        torque_parameters=MotorTorqueParameters(ktau=1.0 / newton_metres),
        stiffness=stiffness,
        damping=damping,
        max_stiffness=_STIFFEST * stiffness,
        max_damping=_STIFFEST * damping,
    )


#: The current measurement of each field.
_MEASURED: dict[Field, Callable[[BoardState], NDArray[Any]]] = {
    Field.JOINT_POSITIONS: lambda boards: boards.position,
    Field.JOINT_VELOCITIES: lambda boards: boards.velocity,
    Field.JOINT_ACCELERATIONS: BoardState.accelerations_now,
    Field.MOTOR_POSITIONS: lambda boards: boards.motor_motion()[0],
    Field.MOTOR_VELOCITIES: lambda boards: boards.motor_motion()[1],
    Field.MOTOR_ACCELERATIONS: BoardState.motor_accelerations,
    Field.TORQUES: BoardState.measured_torques,
    Field.DUTY_CYCLES: BoardState.motor_duties,
    Field.CURRENTS: BoardState.motor_currents,
    Field.TEMPERATURES: lambda boards: boards.temperature,
}
