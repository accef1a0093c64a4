"""The axes of a motor board: their configuration, modes and last commands, as arrays with a column for each axis."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.devices.trajectories import Trajectories
from rtf.robot.interfaces import CalibrationParameters, JointType, MotorTorqueParameters, Pid, PidType

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray

#: Initial reference speed (deg/s) and acceleration (deg/s²) of all boards.
SPEED, ACCELERATION = 10.0, 1000.0
#: What stands for a degree in them on a prismatic axis (m).
SLIDE = 0.005


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardAxis:
    """The configuration of an axis and its motor, with the units of :mod:`rtf.robot.interfaces`."""

    name: str
    kind: JointType = JointType.REVOLUTE
    minimum: float = -180.0
    maximum: float = 180.0
    max_velocity: float = 50.0
    max_torque: float = 100.0
    gearbox: float = 1.0  # turns of the rotor a turn of the joint; negative if the directions are opposite
    rotor_resolution: float = 4096.0  # counts a turn
    nominal_current: float = 5.0
    peak_current: float = 15.0
    max_current: float = 20.0  # beyond it for a moment, the axis enters hardware fault
    duty_limit: float = 100.0
    temperature_limit: float = 85.0
    supply_voltage: float = 24.0
    torque_controlled: bool = True  # whether the axis can be compliant
    stiffness: float = 0.0
    damping: float = 0.0
    max_stiffness: float = 1000.0
    max_damping: float = 100.0
    pid: Pid = field(default_factory=Pid)  # of the position
    torque_parameters: MotorTorqueParameters = field(default_factory=MotorTorqueParameters)


class PidSettings:
    """The controllers of one kind: gains, error limits (0: none), and whether they are on."""

    def __init__(self, pids: list[Pid], *, enabled: bool) -> None:
        self.pids = pids
        self.enabled = np.full(len(pids), enabled)
        self.error_limits = np.zeros(len(pids))


class BoardAxes:
    """The arrays. ``couplings``: motors = couplings @ joints, before the gearbox; without it each joint has a motor.

    Only the first set of values is from the configuration: those that clients may change are changed in place.
    """

    #: The present time in steps of the trajectories.
    tick: float = 0.0
    names: tuple[str, ...] = ()

    def set_up(self, axes: Sequence[BoardAxis], couplings: FloatArray | None = None) -> None:
        """Initialize all arrays: the axes are stiff and in position mode, at 0 deg."""
        count = self.count = len(axes)
        column = {
            one.name: np.array([getattr(axis, one.name) for axis in axes], dtype=np.float64)
            for one in fields(BoardAxis)
            if one.type in ("float", "bool")
        }
        self.names = tuple(axis.name for axis in axes)
        self.kinds = tuple(axis.kind for axis in axes)
        # Limits.
        self.minimum, self.maximum = column["minimum"], column["maximum"]
        self.min_velocity, self.max_velocity = np.zeros(count), column["max_velocity"]
        self.max_torque = column["max_torque"]
        self.nominal_current, self.peak_current = column["nominal_current"], column["peak_current"]
        self.max_current, self.duty_limit = column["max_current"], column["duty_limit"]
        self.temperature_limit, self.supply_voltage = column["temperature_limit"], column["supply_voltage"]
        # Motors.
        self.configured_gearbox, self.rotor_resolution = column["gearbox"], column["rotor_resolution"]
        self.configured_couplings = np.eye(count) if couplings is None else couplings.copy()
        self.torque_controlled = column["torque_controlled"] > 0
        self.torque_parameters = [axis.torque_parameters for axis in axes]
        # Controllers.
        self.controls = {
            kind: PidSettings(
                [axis.pid if kind is PidType.POSITION else Pid() for axis in axes], enabled=kind is PidType.POSITION
            )
            for kind in PidType
        }
        position = self.controls[PidType.POSITION]
        self.pids, self.pid_enabled, self.pid_error_limits = position.pids, position.enabled, position.error_limits
        self.stiffness, self.damping = column["stiffness"], column["damping"]
        self.max_stiffness, self.max_damping = column["max_stiffness"], column["max_damping"]
        self.impedance_offset = np.zeros(count)
        # Modes, faults, calibration.
        self.modes = np.empty((2, count), dtype=np.int32)
        self.mode, self.interaction = self.modes
        self.mode[:], self.interaction[:] = ControlMode.POSITION, InteractionMode.STIFF
        self._powered = np.ones(count)  # 0 of an axis whose mode has no power
        self.faults: list[tuple[int, str]] = [(0, "")] * count
        self.calibrated = np.ones(count, dtype=bool)
        self.calibration = [CalibrationParameters()] * count
        # Commands.
        #: The units of each axis in place of a degree, in speeds and accelerations that no configuration gives.
        self.degree = np.where([kind is JointType.PRISMATIC for kind in self.kinds], SLIDE, 1.0)
        self.speeds, self.accelerations = SPEED * self.degree, ACCELERATION * self.degree
        self.targets, self.direct, self.velocities = np.zeros(count), np.zeros(count), np.zeros(count)
        self.torques, self.currents, self.duties = np.zeros(count), np.zeros(count), np.zeros(count)
        self.encoder_offsets, self.motor_offsets = np.zeros(count), np.zeros(count)
        self.trajectories = self.make_trajectories()
        self._deadline = np.full(count, np.inf)  # when a command expires, s
        self._expired = np.zeros(count, dtype=bool)
        self._overload = np.zeros(count)
        self._planned: list[tuple[float, int, ControlMode]] = []  # tick, axis and mode of transitions to come

    def unexpired(self, commands: FloatArray) -> FloatArray:
        """Return commands, and 0 for those that have expired."""
        return np.where(self._expired, 0.0, commands)

    def make_trajectories(self) -> Trajectories:
        """Return new trajectories, which hold all axes at 0 deg."""
        return Trajectories(np.zeros(self.count), self.minimum, self.maximum)
