"""Modes, limits, controllers, variables and calibration of a board."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from rtf.bottle import Bottle
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.devices.board_base import BoardBase
from rtf.robot.errors import NotSupportedError, RefusedError
from rtf.robot.extended_state import Field
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

_DIRECT = frozenset({ControlMode.POSITION_DIRECT})
M = TypeVar("M", ControlMode, InteractionMode)
#: The measurement that each kind of controller controls.
_CONTROLLED = {
    PidType.POSITION: Field.JOINT_POSITIONS,
    PidType.VELOCITY: Field.JOINT_VELOCITIES,
    PidType.TORQUE: Field.TORQUES,
    PidType.CURRENT: Field.CURRENTS,
}

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.robot.interfaces import AxisSelection, FloatArray, Values


class BoardSettings(
    BoardBase,
    IAxisInfo,
    IControlMode,
    IInteractionMode,
    IJointFault,
    IControlLimits,
    IPidControl,
    IRemoteVariables,
    IControlCalibration,
):
    """The settings of a board."""

    # IAxisInfo

    def axis_name(self, joint: int) -> str:
        return self.board.names[self._axis(joint)]

    def joint_type(self, joint: int) -> JointType:
        return self.board.kinds[self._axis(joint)]

    # IControlMode, IInteractionMode, IJointFault

    def control_modes(self, joints: AxisSelection = None) -> tuple[ControlMode, ...]:
        axes = self._places(joints)
        self._update()
        return tuple(ControlMode(mode) for mode in self.board.shown_modes()[0, axes].tolist())

    def set_control_modes(self, modes: ControlMode | Sequence[ControlMode], joints: AxisSelection = None) -> None:
        self._request(modes, joints, self.board.request_mode)

    def interaction_modes(self, joints: AxisSelection = None) -> tuple[InteractionMode, ...]:
        return tuple(InteractionMode(mode) for mode in self.board.interaction[self._places(joints)].tolist())

    def set_interaction_modes(
        self, modes: InteractionMode | Sequence[InteractionMode], joints: AxisSelection = None
    ) -> None:
        self._request(modes, joints, self.board.request_interaction)

    def _request(self, modes: M | Sequence[M], joints: AxisSelection, request: Callable[[int, int], None]) -> None:
        """Request a mode of each joint; the first refusal is raised after all requests."""
        axes = self._places(joints).tolist()
        wanted = modes_for(len(axes), modes)
        refused: list[RefusedError] = []
        with self._between_cycles():
            for axis, mode in zip(axes, wanted, strict=True):
                try:
                    request(axis, int(mode))
                except RefusedError as error:
                    refused.append(error)
        if refused:
            raise refused[0]

    def last_joint_fault(self, joint: int) -> tuple[int, str]:
        return self.board.faults[self._axis(joint)]

    # IControlLimits

    def limits(self, joint: int) -> tuple[float, float]:
        axis = self._axis(joint)
        return float(self.board.minimum[axis]), float(self.board.maximum[axis])

    def set_limits(self, joint: int, minimum: float, maximum: float) -> None:
        self._set_range(joint, minimum, maximum, self.board.minimum, self.board.maximum)

    def velocity_limits(self, joint: int) -> tuple[float, float]:
        axis = self._axis(joint)
        return float(self.board.min_velocity[axis]), float(self.board.max_velocity[axis])

    def set_velocity_limits(self, joint: int, minimum: float, maximum: float) -> None:
        if minimum < 0:
            raise RefusedError(f"{self.name} joint {joint}: {minimum:g} is not a limit of a speed; none is below 0")
        self._set_range(joint, minimum, maximum, self.board.min_velocity, self.board.max_velocity)

    def _set_range(self, joint: int, low: float, high: float, lows: FloatArray, highs: FloatArray) -> None:
        axis = self._axis(joint)
        values_for(2, (low, high))
        if not low < high:
            raise RefusedError(f"{self.name} joint {joint}: the limits {low:g} and {high:g} leave nothing between them")
        with self._between_cycles() as board:
            lows[axis], highs[axis] = low, high
            board.refresh(axis)

    # IPidControl

    def pid_count(self) -> int:
        return self.size

    def pid(self, kind: PidType, joint: int) -> Pid:
        return self.board.controls[kind].pids[self._axis(joint)]

    def set_pid(self, kind: PidType, joint: int, pid: Pid) -> None:
        axis = self._axis(joint)
        values_for(len(pid), pid)
        with self._between_cycles() as board:
            board.controls[kind].pids[axis] = pid
            board.driver.configure(axis)

    def pid_references(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        axes, board = self._places(joints), self.board
        self._update()
        if kind is PidType.POSITION:
            return board.trajectories.at(board.tick, axes)[0]
        setpoints = {PidType.VELOCITY: board.velocities, PidType.TORQUE: board.torques}
        return setpoints.get(kind, board.currents)[axes]

    def set_pid_references(self, kind: PidType, values: Values, joints: AxisSelection = None) -> None:
        """See IPidControl: handled like a direct position, and accepted in the same mode."""
        if kind is not PidType.POSITION:
            raise NotSupportedError(f"{self.name} accepts no references for its controller of {kind.name.lower()}")
        self._command("direct", values, joints, _DIRECT, self.board.follow)

    def pid_errors(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        errors: FloatArray = self.pid_references(kind, joints) - self._measured(_CONTROLLED[kind], joints)
        return errors

    def pid_outputs(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        """See IPidControl: all controllers have the same output."""
        del kind
        axes = self._places(joints)
        self._update()
        return self.board.controller_outputs()[axes]

    def pid_error_limits(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        return self._read(self.board.controls[kind].error_limits, joints)

    def set_pid_error_limits(self, kind: PidType, values: Values, joints: AxisSelection = None) -> None:
        self._write(values, joints, self.board.controls[kind].error_limits)

    def set_pid_offset(self, kind: PidType, joint: int, offset: float) -> None:
        self.set_pid(kind, joint, self.pid(kind, joint)._replace(offset=float(offset)))

    def reset_pid(self, kind: PidType, joint: int) -> None:
        axis = self._axis(joint)
        if kind is PidType.POSITION:
            with self._between_cycles() as board:
                board.driver.reset_controller(axis)

    def enable_pid(self, kind: PidType, joint: int) -> None:
        self._switch(kind, joint, on=True)

    def disable_pid(self, kind: PidType, joint: int) -> None:
        self._switch(kind, joint, on=False)

    def _switch(self, kind: PidType, joint: int, *, on: bool) -> None:
        axis = self._axis(joint)
        with self._between_cycles() as board:
            board.controls[kind].enabled[axis] = on
            board.driver.configure(axis)

    def pid_enabled(self, kind: PidType, joint: int) -> bool:
        return bool(self.board.controls[kind].enabled[self._axis(joint)])

    # IRemoteVariables

    def variables(self) -> tuple[str, ...]:
        return tuple(self._variables())

    def variable(self, key: str) -> Bottle:
        found = self._variables().get(key)
        if found is None:
            raise RefusedError(f"{self.name} has no variable {key!r}; it has {', '.join(self._variables()) or 'none'}")
        return found

    def _variables(self) -> dict[str, Bottle]:
        """Return the variables: couplings, block by block, settings of all joints, and what the driver has."""
        board, own = self.board, self.own
        return {
            "kinematic_mj": Bottle([Bottle(block.ravel().tolist()) for block in self._coupling_blocks()]),
            "torqueControlEnabled": Bottle([Bottle([int(flag) for flag in board.torque_controlled[own].tolist()])]),
            "temperatureLimit": Bottle([Bottle(board.temperature_limit[own].tolist())]),
            **board.driver.variables(),
        }

    def _coupling_blocks(self) -> list[FloatArray]:
        """Return the coupling matrices of the electronic boards of these axes; here one for all of them."""
        return [self.board.configured_couplings[self.own, self.own]]

    def set_variable(self, key: str, value: Bottle) -> None:
        """Raise an error: no variable can be changed."""
        del value
        raise RefusedError(f"{self.name}: the variable {key!r} cannot be changed")

    # IControlCalibration

    def calibrate_axis(self, joint: int, parameters: CalibrationParameters) -> None:
        self.set_calibration_parameters(joint, parameters)
        axis = self._axis(joint)
        with self._between_cycles() as board:
            board.calibrate(axis)

    def set_calibration_parameters(self, joint: int, parameters: CalibrationParameters) -> None:
        axis = self._axis(joint)
        with self.board.lock:
            self.board.calibration[axis] = parameters

    def calibration_done(self, joint: int) -> bool:
        axis = self._axis(joint)
        self._update()
        return bool(self.board.calibrated[axis])
