"""Modes, limits, controllers, variables and calibration of a part."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np

from rtf.bottle import Bottle
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.errors import NotSupportedError, RefusedError
from rtf.robot.interfaces import (
    CalibrationParameters,
    IAxisInfo,
    IControlCalibration,
    IControlLimits,
    IControlMode,
    IInteractionMode,
    IJointFault,
    IPidControl,
    IRemoteVariables,
    JointType,
    Pid,
    PidType,
    modes_for,
    values_for,
)
from rtf.simulator.part.base import PartBase

_DIRECT = frozenset({ControlMode.POSITION_DIRECT})
M = TypeVar("M", ControlMode, InteractionMode)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.robot.interfaces import AxisSelection, FloatArray, Values


class PartSettings(
    PartBase,
    IAxisInfo,
    IControlMode,
    IInteractionMode,
    IJointFault,
    IControlLimits,
    IPidControl,
    IRemoteVariables,
    IControlCalibration,
):
    """The settings of a part."""

    # IAxisInfo

    def axis_name(self, joint: int) -> str:
        return self.description.axes[self._axis(joint) - int(self.own.start)].name

    def joint_type(self, joint: int) -> JointType:
        axis = self.description.axes[self._axis(joint) - int(self.own.start)]
        return JointType.PRISMATIC if axis.prismatic else JointType.REVOLUTE

    # IControlMode, IInteractionMode, IJointFault

    def control_modes(self, joints: AxisSelection = None) -> tuple[ControlMode, ...]:
        return tuple(ControlMode(mode) for mode in self.boards.mode[self._places(joints)].tolist())

    def set_control_modes(self, modes: ControlMode | Sequence[ControlMode], joints: AxisSelection = None) -> None:
        self._request(modes, joints, self.boards.request_mode)

    def interaction_modes(self, joints: AxisSelection = None) -> tuple[InteractionMode, ...]:
        return tuple(InteractionMode(mode) for mode in self.boards.interaction[self._places(joints)].tolist())

    def set_interaction_modes(
        self, modes: InteractionMode | Sequence[InteractionMode], joints: AxisSelection = None
    ) -> None:
        self._request(modes, joints, self.boards.request_interaction)

    def _request(self, modes: M | Sequence[M], joints: AxisSelection, request: Callable[[int, int], None]) -> None:
        """Request a mode of each joint; the first refusal is raised after all requests."""
        axes = self._places(joints).tolist()
        wanted = modes_for(len(axes), modes)
        refused: list[RefusedError] = []
        with self.lock:
            for axis, mode in zip(axes, wanted, strict=True):
                try:
                    request(axis, int(mode))
                except RefusedError as error:
                    refused.append(error)
        if refused:
            raise refused[0]

    def last_joint_fault(self, joint: int) -> tuple[int, str]:
        return self.boards.faults[self._axis(joint)]

    # IControlLimits

    def limits(self, joint: int) -> tuple[float, float]:
        axis = self._axis(joint)
        return float(self.boards.minimum[axis]), float(self.boards.maximum[axis])

    def set_limits(self, joint: int, minimum: float, maximum: float) -> None:
        self._set_range(joint, minimum, maximum, self.boards.minimum, self.boards.maximum)

    def velocity_limits(self, joint: int) -> tuple[float, float]:
        axis = self._axis(joint)
        return float(self.boards.min_velocity[axis]), float(self.boards.max_velocity[axis])

    def set_velocity_limits(self, joint: int, minimum: float, maximum: float) -> None:
        self._set_range(joint, minimum, maximum, self.boards.min_velocity, self.boards.max_velocity)

    def _set_range(self, joint: int, low: float, high: float, lows: FloatArray, highs: FloatArray) -> None:
        axis = self._axis(joint)
        values_for(2, (low, high))
        if not low < high:
            raise RefusedError(f"{self.part} joint {joint}: the limits {low:g} and {high:g} leave nothing between them")
        with self.lock:
            lows[axis], highs[axis] = low, high
            self.boards.refresh(axis)

    # IPidControl

    def pid_count(self) -> int:
        return self.size

    def pid(self, kind: PidType, joint: int) -> Pid:
        axis = self._axis(joint)
        return self.boards.pids[axis] if kind is PidType.POSITION else self.boards.other_pids.get((kind, axis), Pid())

    def set_pid(self, kind: PidType, joint: int, pid: Pid) -> None:
        axis = self._axis(joint)
        values_for(len(pid), pid)
        with self.lock:
            if kind is PidType.POSITION:
                self.boards.set_pid(axis, pid)
            else:
                self.boards.other_pids[kind, axis] = pid  # kept; only the position controller is simulated

    def pid_references(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        axes = self._places(joints)
        if kind is PidType.POSITION:
            return self.boards.setpoints.at(self.boards.tick, axes)[0]
        return {PidType.VELOCITY: self.boards.velocities, PidType.TORQUE: self.boards.torques}.get(
            kind, self.boards.currents
        )[axes]

    def set_pid_references(self, kind: PidType, values: Values, joints: AxisSelection = None) -> None:
        """See IPidControl: handled like a direct position, and accepted in the same mode."""
        if kind is not PidType.POSITION:
            raise NotSupportedError(f"{self.part} accepts no references for its controller of {kind.name.lower()}")
        self._command("direct", values, joints, _DIRECT, self.boards.follow)

    def pid_errors(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        axes = self._places(joints)
        measured = {
            PidType.POSITION: lambda: self.boards.position,
            PidType.VELOCITY: lambda: self.boards.velocity,
            PidType.TORQUE: self.boards.measured_torques,
            PidType.CURRENT: self.boards.motor_currents,
        }[kind]()
        errors: FloatArray = self.pid_references(kind, joints) - measured[axes]
        return errors

    def pid_outputs(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        """See IPidControl: all controllers have the same output."""
        del kind
        return self._read(self.boards.output, joints)

    def pid_error_limits(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        if kind is PidType.POSITION:
            return self._read(self.boards.pid_error_limits, joints)
        told = self.boards.other_error_limits
        return np.array([told.get((kind, axis), 0.0) for axis in self._places(joints).tolist()])

    def set_pid_error_limits(self, kind: PidType, values: Values, joints: AxisSelection = None) -> None:
        if kind is PidType.POSITION:
            self._write(values, joints, self.boards.pid_error_limits)
            return
        axes = self._places(joints).tolist()
        given = values_for(len(axes), values).tolist()
        with self.lock:
            for axis, value in zip(axes, given, strict=True):
                self.boards.other_error_limits[kind, axis] = value

    def set_pid_offset(self, kind: PidType, joint: int, offset: float) -> None:
        self.set_pid(kind, joint, self.pid(kind, joint)._replace(offset=offset))

    def reset_pid(self, kind: PidType, joint: int) -> None:
        axis = self._axis(joint)
        if kind is PidType.POSITION:
            with self.lock:
                self.boards.controllers.set_integral(axis, 0.0)

    def enable_pid(self, kind: PidType, joint: int) -> None:
        self._switch(kind, joint, on=True)

    def disable_pid(self, kind: PidType, joint: int) -> None:
        self._switch(kind, joint, on=False)

    def _switch(self, kind: PidType, joint: int, *, on: bool) -> None:
        axis = self._axis(joint)
        with self.lock:
            if kind is PidType.POSITION:
                self.boards.pid_enabled[axis] = on
                self.boards.refresh(axis)
            else:
                self.boards.other_enabled[kind, axis] = on

    def pid_enabled(self, kind: PidType, joint: int) -> bool:
        axis = self._axis(joint)
        if kind is PidType.POSITION:
            return bool(self.boards.pid_enabled[axis])
        return self.boards.other_enabled.get((kind, axis), False)

    # IRemoteVariables

    def variables(self) -> tuple[str, ...]:
        return ("kinematic_mj", "torqueControlEnabled", "temperatureLimit")

    def variable(self, key: str) -> Bottle:
        if key == "kinematic_mj":
            return Bottle(
                [Bottle([value for row in block.tolist() for value in row]) for block in self._coupling_blocks()]
            )
        if key == "torqueControlEnabled":
            return Bottle([Bottle([int(flag) for flag in self.boards.torque_controlled[self.own].tolist()])])
        if key == "temperatureLimit":
            return Bottle([Bottle([float(limit) for limit in self.boards.temperature_limit[self.own].tolist()])])
        raise RefusedError(f"{self.part} has no variable {key!r}; it has {', '.join(self.variables())}")

    def _coupling_blocks(self) -> list[FloatArray]:
        matrix = self.boards.configured_couplings[self.own, self.own]
        return [
            matrix[block.first : block.first + block.size, block.first : block.first + block.size]
            for block in self.description.couplings
        ]

    def set_variable(self, key: str, value: Bottle) -> None:
        """Raise an error: no variable can be changed."""
        del value
        raise RefusedError(f"{self.part}: the variable {key!r} cannot be changed")

    # IControlCalibration

    def calibrate_axis(self, joint: int, parameters: CalibrationParameters) -> None:
        self.set_calibration_parameters(joint, parameters)
        axis = self._axis(joint)
        with self.lock:
            self.boards.calibrate(axis)

    def set_calibration_parameters(self, joint: int, parameters: CalibrationParameters) -> None:
        with self.lock:
            self.boards.calibration[self._axis(joint)] = parameters

    def calibration_done(self, joint: int) -> bool:
        return bool(self.boards.calibrated[self._axis(joint)])
