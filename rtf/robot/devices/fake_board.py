"""A control board without hardware: its joints follow commands by kinematics alone, in the robot's time.

It obeys the rules of a board (control modes, limits, ignored commands), so that clients of boards can be tested on it.
:mod:`rtf.robot.devices.fake_axes` lists what it does not model.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf import clock
from rtf.bottle import Bottle, Property, as_float, as_string, to_string
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.device import Device
from rtf.robot.devices.calibrated_board import Calibrated
from rtf.robot.devices.fake_axes import FakeAxes
from rtf.robot.devices.fake_board_moves import SPEED_LIMITS, FakeForces, FakeMoves
from rtf.robot.devices.fake_board_parts import SETTINGS, FakeMotors, FakePids
from rtf.robot.errors import NotSupportedError, RefusedError
from rtf.robot.extended_state import ExtendedState, IStateSource
from rtf.robot.interfaces import (
    CalibrationParameters,
    IAxisInfo,
    IControlCalibration,
    IControlLimits,
    IControlMode,
    IInteractionMode,
    IJointFault,
    IRemoteVariables,
    JointType,
    MotorTorqueParameters,
    modes_for,
    values_for,
)
from rtf.robot.parameters import count, group_of, wrong

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.ports.network import Network
    from rtf.robot.interfaces import AxisSelection, FloatArray

MAX_JOINTS = 1000
#: Default limits of a joint, in deg.
LIMITS = (0.0, 100.0)
_TYPES = {"revolute": JointType.REVOLUTE, "prismatic": JointType.PRISMATIC}


class FakeBoard(
    FakeMoves,
    FakeForces,
    FakeMotors,
    FakePids,
    IAxisInfo,
    IControlMode,
    IInteractionMode,
    IControlLimits,
    IControlCalibration,
    IJointFault,
    IRemoteVariables,
    IStateSource,
    Calibrated,
):
    """``fakeMotionControl``: it starts at 0 deg, in position mode, stiff.

    Configuration groups: ``GENERAL`` with ``Joints`` (their number), ``AxisName`` and ``AxisType`` (lists), ``LIMITS``
    with ``Min`` and ``Max`` (deg), ``VARIABLES`` with remote variables by name.
    """

    def __init__(self, name: str = "", *, network: Network | None = None) -> None:
        super().__init__()
        Device.__init__(self, name, network=network)
        self._names: list[str] = []
        self._types: list[JointType] = []
        self._variables: dict[str, Bottle] = {}
        self._interaction: list[InteractionMode] = []
        self._calibrated: list[bool] = []
        self._calibration: list[CalibrationParameters] = []

    # Device ------------------------------------------------------------------------------------------------------

    def open(self, configuration: Property) -> None:
        general = group_of(configuration, "GENERAL")
        joints = count(general, "Joints", 1, MAX_JOINTS)
        names = _listed(general, "AxisName", joints) or [f"joint{joint}" for joint in range(joints)]
        types = _listed(general, "AxisType", joints) or ["revolute"] * joints
        limits = group_of(configuration, "LIMITS")
        minima, maxima = (
            _numbers(limits, key, joints, default) for key, default in zip(("Min", "Max"), LIMITS, strict=True)
        )
        if (minima > maxima).any():
            raise wrong(limits, "Min", f"joint {int((minima > maxima).argmax())} has a minimum above its maximum")
        self._names = [as_string(name) for name in names]
        self._types = [_TYPES.get(as_string(kind), JointType.UNKNOWN) for kind in types]
        variables = configuration.find_group("VARIABLES")
        self._variables = {
            as_string(one[0]): one.tail() for one in variables or () if isinstance(one, Bottle) and len(one)
        }
        self._start(minima, maxima)

    def _start(self, minima: FloatArray, maxima: FloatArray) -> None:
        joints = len(minima)
        self._axes = FakeAxes(minima, maxima, clock.current().now())
        self._settings = {name: np.full(joints, value) for name, value in SETTINGS.items()}
        self._settings["motor_zero"] = np.zeros(joints)
        self._speed_limits = np.tile(SPEED_LIMITS, (joints, 1))
        self._impedances = np.zeros((joints, 2))
        self._impedance_offsets = np.zeros(joints)
        self._motor_torques = [MotorTorqueParameters()] * joints
        self._interaction = [InteractionMode.STIFF] * joints
        self._calibrated = [True] * joints
        self._calibration = [CalibrationParameters()] * joints
        self._faults.clear()
        self._set_up_pids(joints)

    def close(self) -> None:
        """Do nothing: there are no resources."""

    # Axes --------------------------------------------------------------------------------------------------------

    def axes(self) -> int:
        return self._axes.count

    def axis_name(self, joint: int) -> str:
        return self._names[self._one(joint)]

    def joint_type(self, joint: int) -> JointType:
        return self._types[self._one(joint)]

    # State -------------------------------------------------------------------------------------------------------

    def fill_state(self, state: ExtendedState) -> float:
        with self._lock:
            axes = self._now()
            gearbox = self._settings["gearbox_ratio"]
            state.joint_positions[:] = axes.positions
            state.joint_velocities[:] = axes.speeds
            state.joint_accelerations[:] = axes.accelerations
            np.multiply(axes.positions, gearbox, out=state.motor_positions)
            state.motor_positions += self._settings["motor_zero"]
            np.multiply(axes.speeds, gearbox, out=state.motor_velocities)
            np.multiply(axes.accelerations, gearbox, out=state.motor_accelerations)
            state.torques[:] = axes.measured(ControlMode.TORQUE)
            state.duty_cycles[:] = axes.measured(ControlMode.PWM)
            state.currents[:] = axes.measured(ControlMode.CURRENT)
            state.control_modes[:] = axes.modes
            state.interaction_modes[:] = self._interaction
            state.temperatures[:] = self.temperatures()
            state.valid.fill(True)
            return axes.time

    # Modes -------------------------------------------------------------------------------------------------------

    def control_modes(self, joints: AxisSelection = None) -> tuple[ControlMode, ...]:
        with self._lock:
            return tuple(self._axes.modes[joint] for joint in self._chosen(joints))

    def set_control_modes(self, modes: ControlMode | Sequence[ControlMode], joints: AxisSelection = None) -> None:
        with self._lock:
            chosen = self._chosen(joints)
            for joint, mode in zip(chosen, modes_for(len(chosen), modes), strict=True):
                self._request(joint, mode)

    def interaction_modes(self, joints: AxisSelection = None) -> tuple[InteractionMode, ...]:
        with self._lock:
            return tuple(self._interaction[joint] for joint in self._chosen(joints))

    def set_interaction_modes(
        self, modes: InteractionMode | Sequence[InteractionMode], joints: AxisSelection = None
    ) -> None:
        with self._lock:
            chosen = self._chosen(joints)
            for joint, mode in zip(chosen, modes_for(len(chosen), modes), strict=True):
                if mode is InteractionMode.UNKNOWN:
                    raise RefusedError(f"joint {joint}: the interaction mode 'unknown' cannot be set")
                self._interaction[joint] = mode

    def last_joint_fault(self, joint: int) -> tuple[int, str]:
        with self._lock:
            return self._faults.get(self._one(joint), (0, ""))

    # Limits, calibration, variables ------------------------------------------------------------------------------

    def limits(self, joint: int) -> tuple[float, float]:
        chosen = self._one(joint)
        return float(self._axes.minima[chosen]), float(self._axes.maxima[chosen])

    def set_limits(self, joint: int, minimum: float, maximum: float) -> None:
        chosen = self._one(joint)
        least, greatest = values_for(2, (minimum, maximum))
        if least > greatest:
            raise RefusedError(f"joint {joint}: the limits {minimum:g} and {maximum:g} are in the wrong order")
        self._axes.minima[chosen], self._axes.maxima[chosen] = least, greatest

    def velocity_limits(self, joint: int) -> tuple[float, float]:
        least, greatest = self._speed_limits[self._one(joint)]
        return float(least), float(greatest)

    def set_velocity_limits(self, joint: int, minimum: float, maximum: float) -> None:
        chosen = self._one(joint)
        least, greatest = values_for(2, (minimum, maximum))
        if not 0 <= least <= greatest:
            raise RefusedError(f"joint {joint}: {minimum:g} and {maximum:g} are not limits of a speed")
        self._speed_limits[chosen] = least, greatest

    def calibrate_axis(self, joint: int, parameters: CalibrationParameters) -> None:
        """Calibrate a joint, at once."""
        self.set_calibration_parameters(joint, parameters)
        self._calibrated[self._one(joint)] = True

    def set_calibration_parameters(self, joint: int, parameters: CalibrationParameters) -> None:
        self._calibration[self._one(joint)] = parameters

    def calibration_done(self, joint: int) -> bool:
        return self._calibrated[self._one(joint)]

    def variable(self, key: str) -> Bottle:
        found = self._variables.get(key)
        if found is None:
            raise RefusedError(f"{self.name} has no variable {key!r}; there are {', '.join(self._variables) or 'none'}")
        return found[:]

    def set_variable(self, key: str, value: Bottle) -> None:
        self.variable(key)
        self._variables[key] = value

    def variables(self) -> tuple[str, ...]:
        if not self._variables:
            raise NotSupportedError(f"{self.name} has no variables; its group VARIABLES may give it some")
        return tuple(self._variables)


def _listed(group: Property, key: str, joints: int) -> Bottle | None:
    """Return a list with an element for each joint; None if it is missing."""
    value = group.find(key)
    if value is None:
        return None
    if not isinstance(value, Bottle) or len(value) != joints:
        raise wrong(group, key, f"{to_string(value)[:60]} is not a list of {joints} elements, one for each joint")
    return value


def _numbers(group: Property, key: str, joints: int, default: float) -> FloatArray:
    """Return a number for each joint."""
    values = _listed(group, key, joints) or [default] * joints
    if not all(isinstance(value, int | float) for value in values):
        raise wrong(group, key, f"{to_string(group.find(key))[:60]} are not all numbers")
    return values_for(joints, [as_float(value) for value in values])
