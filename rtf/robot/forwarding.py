"""A control board that does nothing itself: every method of every interface, made of a few ways of passing it on.

A client passes the methods on through the network, a remapper to other boards. Each says how in five methods; here they
are told which method of an interface it is, as the function itself, so that arguments and results are checked.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeAlias, TypeVar

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import (
    AxisSelection,
    CalibrationParameters,
    FloatArray,
    IAmplifierControl,
    IAxisInfo,
    IControlCalibration,
    IControlLimits,
    IControlMode,
    ICurrentControl,
    IEncoders,
    IImpedanceControl,
    IInteractionMode,
    IJointFault,
    IMotor,
    IMotorEncoders,
    IPidControl,
    IPositionControl,
    IPositionDirect,
    IPWMControl,
    IRemoteCalibrator,
    ITorqueControl,
    IVelocityControl,
    JointType,
    MotorTorqueParameters,
    Pid,
    PidType,
    Values,
    selected,
    values_for,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.robot.control_modes import ControlMode, InteractionMode

P = ParamSpec("P")
R = TypeVar("R")
M = TypeVar("M")
#: A method of an interface that takes any choice of axes.
Plural: TypeAlias = "Callable[..., Any]"


class ForwardedBoard(
    IAxisInfo,
    IEncoders,
    IMotorEncoders,
    IMotor,
    IPositionControl,
    IVelocityControl,
    IPositionDirect,
    IControlMode,
    IInteractionMode,
    ITorqueControl,
    IImpedanceControl,
    ICurrentControl,
    IPWMControl,
    IControlLimits,
    IPidControl,
    IAmplifierControl,
    IControlCalibration,
    IRemoteCalibrator,
    IJointFault,
):
    """All interfaces of a board; ``axes`` and the five below are what is left to say."""

    @abstractmethod
    def forward_reading(self, method: Plural, axes: list[int], *of: object) -> Sequence[Any]:
        """What a plural method gives for these axes, one value for each. ``of`` goes before the axes: a kind of PID."""

    @abstractmethod
    def forward_setting(self, method: Plural, values: Sequence[Any], axes: list[int], *of: object) -> None:
        """Have a plural method set these axes; there is a value for each."""

    @abstractmethod
    def forward_action(self, method: Plural, axes: list[int]) -> list[Any]:
        """Have a method do something for these axes; returns what it gave, of each call that was made of it."""

    @abstractmethod
    def forward_single(self, method: Callable[..., R], axis: int, *arguments: object, of: tuple[object, ...] = ()) -> R:
        """What a method of one axis gives. ``of`` goes before the axis, the arguments behind it."""

    @abstractmethod
    def forward_whole(self, method: Callable[..., R], *arguments: object) -> R:
        """What a method of the whole board gives."""

    # How the methods below are made -------------------------------------------------------------------------------

    def _chosen(self, axes: AxisSelection) -> list[int]:
        return selected(self.axes(), axes)

    def _numbers(self, method: Plural, axes: AxisSelection, *of: object) -> FloatArray:
        return np.asarray(self.forward_reading(method, self._chosen(axes), *of), dtype=np.float64)

    def _set_numbers(self, method: Plural, values: Values, axes: AxisSelection, *of: object) -> None:
        chosen = self._chosen(axes)
        self.forward_setting(method, values_for(len(chosen), values).tolist(), chosen, *of)

    def _set_modes(self, method: Plural, modes: M | Sequence[M], axes: AxisSelection) -> None:
        """One mode for all of them, or one for each."""
        chosen = self._chosen(axes)
        wanted = [*modes] if isinstance(modes, (list, tuple)) else [modes] * len(chosen)
        if len(wanted) != len(chosen):
            raise RefusedError(f"{len(chosen)} modes are needed, {len(wanted)} were given")
        self.forward_setting(method, wanted, chosen)

    def _single(
        self, method: Callable[Concatenate[Any, int, P], R], axis: int, *arguments: P.args, **named: P.kwargs
    ) -> R:
        [axis] = self._chosen(axis)
        return self.forward_single(method, axis, *arguments, *named.values())

    def _pid(
        self,
        method: Callable[Concatenate[Any, PidType, int, P], R],
        kind: PidType,
        axis: int,
        *arguments: P.args,
        **named: P.kwargs,
    ) -> R:
        [axis] = self._chosen(axis)
        return self.forward_single(method, axis, *arguments, *named.values(), of=(kind,))

    # Axes ------------------------------------------------------------------------------------------------------------

    def axis_name(self, joint: int) -> str:
        """See IAxisInfo."""
        return self._single(IAxisInfo.axis_name, joint)

    def joint_type(self, joint: int) -> JointType:
        """See IAxisInfo."""
        return self._single(IAxisInfo.joint_type, joint)

    # Encoders --------------------------------------------------------------------------------------------------------

    def encoders(self, joints: AxisSelection = None) -> FloatArray:
        """See IEncoders."""
        return self._numbers(IEncoders.encoders, joints)

    def encoder_speeds(self, joints: AxisSelection = None) -> FloatArray:
        """See IEncoders."""
        return self._numbers(IEncoders.encoder_speeds, joints)

    def encoder_accelerations(self, joints: AxisSelection = None) -> FloatArray:
        """See IEncoders."""
        return self._numbers(IEncoders.encoder_accelerations, joints)

    def encoder_times(self, joints: AxisSelection = None) -> FloatArray:
        """See IEncoders."""
        return self._numbers(IEncoders.encoder_times, joints)

    def set_encoders(self, values: Values, joints: AxisSelection = None) -> None:
        """See IEncoders."""
        self._set_numbers(IEncoders.set_encoders, values, joints)

    def reset_encoders(self, joints: AxisSelection = None) -> None:
        """See IEncoders."""
        self.forward_action(IEncoders.reset_encoders, self._chosen(joints))

    # Motors ----------------------------------------------------------------------------------------------------------

    def motor_encoder_count(self) -> int:
        """See IMotorEncoders: each axis has one."""
        return self.axes()

    def motor_encoders(self, motors: AxisSelection = None) -> FloatArray:
        """See IMotorEncoders."""
        return self._numbers(IMotorEncoders.motor_encoders, motors)

    def motor_encoder_speeds(self, motors: AxisSelection = None) -> FloatArray:
        """See IMotorEncoders."""
        return self._numbers(IMotorEncoders.motor_encoder_speeds, motors)

    def motor_encoder_accelerations(self, motors: AxisSelection = None) -> FloatArray:
        """See IMotorEncoders."""
        return self._numbers(IMotorEncoders.motor_encoder_accelerations, motors)

    def set_motor_encoders(self, values: Values, motors: AxisSelection = None) -> None:
        """See IMotorEncoders."""
        self._set_numbers(IMotorEncoders.set_motor_encoders, values, motors)

    def reset_motor_encoders(self, motors: AxisSelection = None) -> None:
        """See IMotorEncoders."""
        self.forward_action(IMotorEncoders.reset_motor_encoders, self._chosen(motors))

    def counts_per_revolution(self, motor: int) -> float:
        """See IMotorEncoders."""
        return self._single(IMotorEncoders.counts_per_revolution, motor)

    def set_counts_per_revolution(self, motor: int, counts: float) -> None:
        """See IMotorEncoders."""
        self._single(IMotorEncoders.set_counts_per_revolution, motor, counts)

    def motor_count(self) -> int:
        """See IMotor: each axis has one."""
        return self.axes()

    def temperatures(self, motors: AxisSelection = None) -> FloatArray:
        """See IMotor."""
        return self._numbers(IMotor.temperatures, motors)

    def temperature_limit(self, motor: int) -> float:
        """See IMotor."""
        return self._single(IMotor.temperature_limit, motor)

    def set_temperature_limit(self, motor: int, limit: float) -> None:
        """See IMotor."""
        self._single(IMotor.set_temperature_limit, motor, limit)

    def gearbox_ratio(self, motor: int) -> float:
        """See IMotor."""
        return self._single(IMotor.gearbox_ratio, motor)

    def set_gearbox_ratio(self, motor: int, ratio: float) -> None:
        """See IMotor."""
        self._single(IMotor.set_gearbox_ratio, motor, ratio)

    # Moving ----------------------------------------------------------------------------------------------------------

    def position_move(self, targets: Values, joints: AxisSelection = None) -> None:
        """See IPositionControl."""
        self._set_numbers(IPositionControl.position_move, targets, joints)

    def relative_move(self, distances: Values, joints: AxisSelection = None) -> None:
        """See IPositionControl."""
        self._set_numbers(IPositionControl.relative_move, distances, joints)

    def motion_done(self, joints: AxisSelection = None) -> bool:
        """See IPositionControl."""
        return all(self.forward_action(IPositionControl.motion_done, self._chosen(joints)))

    def target_positions(self, joints: AxisSelection = None) -> FloatArray:
        """See IPositionControl."""
        return self._numbers(IPositionControl.target_positions, joints)

    def set_reference_speeds(self, speeds: Values, joints: AxisSelection = None) -> None:
        """See IPositionControl."""
        self._set_numbers(IPositionControl.set_reference_speeds, speeds, joints)

    def reference_speeds(self, joints: AxisSelection = None) -> FloatArray:
        """See IPositionControl."""
        return self._numbers(IPositionControl.reference_speeds, joints)

    def set_reference_accelerations(self, accelerations: Values, joints: AxisSelection = None) -> None:
        """See IPositionControl."""
        self._set_numbers(IPositionControl.set_reference_accelerations, accelerations, joints)

    def reference_accelerations(self, joints: AxisSelection = None) -> FloatArray:
        """See IPositionControl."""
        return self._numbers(IPositionControl.reference_accelerations, joints)

    def stop(self, joints: AxisSelection = None) -> None:
        """See IPositionControl."""
        self.forward_action(IPositionControl.stop, self._chosen(joints))

    def velocity_move(self, velocities: Values, joints: AxisSelection = None) -> None:
        """See IVelocityControl."""
        self._set_numbers(IVelocityControl.velocity_move, velocities, joints)

    def target_velocities(self, joints: AxisSelection = None) -> FloatArray:
        """See IVelocityControl."""
        return self._numbers(IVelocityControl.target_velocities, joints)

    def set_positions(self, positions: Values, joints: AxisSelection = None) -> None:
        """See IPositionDirect."""
        self._set_numbers(IPositionDirect.set_positions, positions, joints)

    def reference_positions(self, joints: AxisSelection = None) -> FloatArray:
        """See IPositionDirect."""
        return self._numbers(IPositionDirect.reference_positions, joints)

    # Torques, impedances, currents and duty cycles -------------------------------------------------------------------

    def torques(self, joints: AxisSelection = None) -> FloatArray:
        """See ITorqueControl."""
        return self._numbers(ITorqueControl.torques, joints)

    def torque_range(self, joint: int) -> tuple[float, float]:
        """See ITorqueControl."""
        return self._single(ITorqueControl.torque_range, joint)

    def set_reference_torques(self, torques: Values, joints: AxisSelection = None) -> None:
        """See ITorqueControl."""
        self._set_numbers(ITorqueControl.set_reference_torques, torques, joints)

    def reference_torques(self, joints: AxisSelection = None) -> FloatArray:
        """See ITorqueControl."""
        return self._numbers(ITorqueControl.reference_torques, joints)

    def motor_torque_parameters(self, joint: int) -> MotorTorqueParameters:
        """See ITorqueControl."""
        return self._single(ITorqueControl.motor_torque_parameters, joint)

    def set_motor_torque_parameters(self, joint: int, parameters: MotorTorqueParameters) -> None:
        """See ITorqueControl."""
        self._single(ITorqueControl.set_motor_torque_parameters, joint, parameters)

    def impedance(self, joint: int) -> tuple[float, float]:
        """See IImpedanceControl."""
        return self._single(IImpedanceControl.impedance, joint)

    def set_impedance(self, joint: int, stiffness: float, damping: float) -> None:
        """See IImpedanceControl."""
        self._single(IImpedanceControl.set_impedance, joint, stiffness, damping)

    def impedance_offset(self, joint: int) -> float:
        """See IImpedanceControl."""
        return self._single(IImpedanceControl.impedance_offset, joint)

    def set_impedance_offset(self, joint: int, offset: float) -> None:
        """See IImpedanceControl."""
        self._single(IImpedanceControl.set_impedance_offset, joint, offset)

    def impedance_limits(self, joint: int) -> tuple[float, float, float, float]:
        """See IImpedanceControl."""
        return self._single(IImpedanceControl.impedance_limits, joint)

    def currents(self, motors: AxisSelection = None) -> FloatArray:
        """See ICurrentControl."""
        return self._numbers(ICurrentControl.currents, motors)

    def current_range(self, motor: int) -> tuple[float, float]:
        """See ICurrentControl."""
        return self._single(ICurrentControl.current_range, motor)

    def set_reference_currents(self, currents: Values, motors: AxisSelection = None) -> None:
        """See ICurrentControl."""
        self._set_numbers(ICurrentControl.set_reference_currents, currents, motors)

    def reference_currents(self, motors: AxisSelection = None) -> FloatArray:
        """See ICurrentControl."""
        return self._numbers(ICurrentControl.reference_currents, motors)

    def set_reference_duty_cycles(self, duties: Values, motors: AxisSelection = None) -> None:
        """See IPWMControl."""
        self._set_numbers(IPWMControl.set_reference_duty_cycles, duties, motors)

    def reference_duty_cycles(self, motors: AxisSelection = None) -> FloatArray:
        """See IPWMControl."""
        return self._numbers(IPWMControl.reference_duty_cycles, motors)

    def duty_cycles(self, motors: AxisSelection = None) -> FloatArray:
        """See IPWMControl."""
        return self._numbers(IPWMControl.duty_cycles, motors)

    # Modes, faults and limits ----------------------------------------------------------------------------------------

    def control_modes(self, joints: AxisSelection = None) -> tuple[ControlMode, ...]:
        """See IControlMode."""
        return tuple(self.forward_reading(IControlMode.control_modes, self._chosen(joints)))

    def set_control_modes(self, modes: ControlMode | Sequence[ControlMode], joints: AxisSelection = None) -> None:
        """See IControlMode."""
        self._set_modes(IControlMode.set_control_modes, modes, joints)

    def interaction_modes(self, joints: AxisSelection = None) -> tuple[InteractionMode, ...]:
        """See IInteractionMode."""
        return tuple(self.forward_reading(IInteractionMode.interaction_modes, self._chosen(joints)))

    def set_interaction_modes(
        self, modes: InteractionMode | Sequence[InteractionMode], joints: AxisSelection = None
    ) -> None:
        """See IInteractionMode."""
        self._set_modes(IInteractionMode.set_interaction_modes, modes, joints)

    def last_joint_fault(self, joint: int) -> tuple[int, str]:
        """See IJointFault."""
        return self._single(IJointFault.last_joint_fault, joint)

    def limits(self, joint: int) -> tuple[float, float]:
        """See IControlLimits."""
        return self._single(IControlLimits.limits, joint)

    def set_limits(self, joint: int, minimum: float, maximum: float) -> None:
        """See IControlLimits."""
        self._single(IControlLimits.set_limits, joint, minimum, maximum)

    def velocity_limits(self, joint: int) -> tuple[float, float]:
        """See IControlLimits."""
        return self._single(IControlLimits.velocity_limits, joint)

    def set_velocity_limits(self, joint: int, minimum: float, maximum: float) -> None:
        """See IControlLimits."""
        self._single(IControlLimits.set_velocity_limits, joint, minimum, maximum)

    # Controllers -----------------------------------------------------------------------------------------------------

    def pid(self, kind: PidType, joint: int) -> Pid:
        """See IPidControl."""
        return self._pid(IPidControl.pid, kind, joint)

    def set_pid(self, kind: PidType, joint: int, pid: Pid) -> None:
        """See IPidControl."""
        self._pid(IPidControl.set_pid, kind, joint, pid)

    def pid_count(self) -> int:
        """See IPidControl: each axis has one of each kind."""
        return self.axes()

    def pid_references(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        """See IPidControl."""
        return self._numbers(IPidControl.pid_references, joints, kind)

    def set_pid_references(self, kind: PidType, values: Values, joints: AxisSelection = None) -> None:
        """See IPidControl."""
        self._set_numbers(IPidControl.set_pid_references, values, joints, kind)

    def pid_errors(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        """See IPidControl."""
        return self._numbers(IPidControl.pid_errors, joints, kind)

    def pid_outputs(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        """See IPidControl."""
        return self._numbers(IPidControl.pid_outputs, joints, kind)

    def pid_error_limits(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        """See IPidControl."""
        return self._numbers(IPidControl.pid_error_limits, joints, kind)

    def set_pid_error_limits(self, kind: PidType, values: Values, joints: AxisSelection = None) -> None:
        """See IPidControl."""
        self._set_numbers(IPidControl.set_pid_error_limits, values, joints, kind)

    def set_pid_offset(self, kind: PidType, joint: int, offset: float) -> None:
        """See IPidControl."""
        self._pid(IPidControl.set_pid_offset, kind, joint, offset)

    def reset_pid(self, kind: PidType, joint: int) -> None:
        """See IPidControl."""
        self._pid(IPidControl.reset_pid, kind, joint)

    def enable_pid(self, kind: PidType, joint: int) -> None:
        """See IPidControl."""
        self._pid(IPidControl.enable_pid, kind, joint)

    def disable_pid(self, kind: PidType, joint: int) -> None:
        """See IPidControl."""
        self._pid(IPidControl.disable_pid, kind, joint)

    def pid_enabled(self, kind: PidType, joint: int) -> bool:
        """See IPidControl."""
        return self._pid(IPidControl.pid_enabled, kind, joint)

    # Amplifiers ------------------------------------------------------------------------------------------------------

    def enable_amplifier(self, joint: int) -> None:
        """See IAmplifierControl."""
        self._single(IAmplifierControl.enable_amplifier, joint)

    def disable_amplifier(self, joint: int) -> None:
        """See IAmplifierControl."""
        self._single(IAmplifierControl.disable_amplifier, joint)

    def amplifier_status(self, joints: AxisSelection = None) -> tuple[int, ...]:
        """See IAmplifierControl."""
        return tuple(self.forward_reading(IAmplifierControl.amplifier_status, self._chosen(joints)))

    def max_current(self, joint: int) -> float:
        """See IAmplifierControl."""
        return self._single(IAmplifierControl.max_current, joint)

    def set_max_current(self, joint: int, current: float) -> None:
        """See IAmplifierControl."""
        self._single(IAmplifierControl.set_max_current, joint, current)

    def nominal_current(self, motor: int) -> float:
        """See IAmplifierControl."""
        return self._single(IAmplifierControl.nominal_current, motor)

    def set_nominal_current(self, motor: int, current: float) -> None:
        """See IAmplifierControl."""
        self._single(IAmplifierControl.set_nominal_current, motor, current)

    def peak_current(self, motor: int) -> float:
        """See IAmplifierControl."""
        return self._single(IAmplifierControl.peak_current, motor)

    def set_peak_current(self, motor: int, current: float) -> None:
        """See IAmplifierControl."""
        self._single(IAmplifierControl.set_peak_current, motor, current)

    def pwm(self, motor: int) -> float:
        """See IAmplifierControl."""
        return self._single(IAmplifierControl.pwm, motor)

    def pwm_limit(self, motor: int) -> float:
        """See IAmplifierControl."""
        return self._single(IAmplifierControl.pwm_limit, motor)

    def set_pwm_limit(self, motor: int, limit: float) -> None:
        """See IAmplifierControl."""
        self._single(IAmplifierControl.set_pwm_limit, motor, limit)

    def supply_voltage(self, motor: int) -> float:
        """See IAmplifierControl."""
        return self._single(IAmplifierControl.supply_voltage, motor)

    # Calibration -----------------------------------------------------------------------------------------------------

    def calibrate_axis(self, joint: int, parameters: CalibrationParameters) -> None:
        """See IControlCalibration."""
        self._single(IControlCalibration.calibrate_axis, joint, parameters)

    def set_calibration_parameters(self, joint: int, parameters: CalibrationParameters) -> None:
        """See IControlCalibration."""
        self._single(IControlCalibration.set_calibration_parameters, joint, parameters)

    def calibration_done(self, joint: int) -> bool:
        """See IControlCalibration."""
        return self._single(IControlCalibration.calibration_done, joint)

    def has_calibrator(self) -> bool:
        """See IRemoteCalibrator."""
        return self.forward_whole(IRemoteCalibrator.has_calibrator)

    def calibrate_joint(self, joint: int) -> None:
        """See IRemoteCalibrator."""
        self._single(IRemoteCalibrator.calibrate_joint, joint)

    def calibrate_part(self) -> None:
        """See IRemoteCalibrator."""
        self.forward_whole(IRemoteCalibrator.calibrate_part)

    def home_joint(self, joint: int) -> None:
        """See IRemoteCalibrator."""
        self._single(IRemoteCalibrator.home_joint, joint)

    def home_part(self) -> None:
        """See IRemoteCalibrator."""
        self.forward_whole(IRemoteCalibrator.home_part)

    def park_joint(self, joint: int) -> None:
        """See IRemoteCalibrator."""
        self._single(IRemoteCalibrator.park_joint, joint)

    def park_part(self) -> None:
        """See IRemoteCalibrator."""
        self.forward_whole(IRemoteCalibrator.park_part)

    def quit_calibrate(self) -> None:
        """See IRemoteCalibrator."""
        self.forward_whole(IRemoteCalibrator.quit_calibrate)

    def quit_park(self) -> None:
        """See IRemoteCalibrator."""
        self.forward_whole(IRemoteCalibrator.quit_park)
