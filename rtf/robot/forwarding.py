"""A control board that does nothing itself: every method of every interface, made of a few ways of passing it on.

A client passes the methods on through the network, a remapper to other boards. Each says how in five methods; they are
told which method of an interface it is, as the function itself. What a method takes and gives is what its interface
says, so that calls are checked as those of any other board.
"""

from __future__ import annotations

import inspect
from abc import abstractmethod
from functools import update_wrapper
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar, cast

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import (
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
    modes_for,
    selected,
    values_for,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.robot.control_modes import ControlMode
    from rtf.robot.interfaces import AxisSelection, FloatArray, Values

R = TypeVar("R")
#: A method of an interface that takes any choice of axes, as the last of its arguments.
Plural: TypeAlias = "Callable[..., Any]"
Method = TypeVar("Method", bound="Callable[..., Any]")
Numbers = TypeVar("Numbers", bound="Callable[..., FloatArray]")
Words = TypeVar("Words", bound="Callable[..., tuple[Any, ...]]")
Truth = TypeVar("Truth", bound="Callable[..., bool]")
Order = TypeVar("Order", bound="Callable[..., None]")


# How a method of an interface becomes one of a forwarded board --------------------------------------------------------


def _made(method: Method, forward: Callable[..., Any]) -> Method:
    """A method that gives its arguments, in the order in which the interface declares them, to ``forward``."""
    signature = inspect.signature(method)
    _, *parameters = signature.parameters.values()
    defaults = tuple(one.default for one in parameters)
    needed = defaults.count(inspect.Parameter.empty)

    def forwarded(board: ForwardedBoard, *given: Any, **named: Any) -> Any:
        if not named and needed <= len(given) <= len(defaults):
            return forward(board, *given, *defaults[len(given) :])
        call = signature.bind(board, *given, **named)
        call.apply_defaults()
        return forward(*call.args)

    return cast("Method", update_wrapper(forwarded, method, updated=()))  # without the mark that it is abstract


def _numbers(method: Numbers) -> Numbers:
    """One that reads a number of each axis. The kind of PID, where there are several, goes before the axes."""

    def read(board: ForwardedBoard, *of_and_axes: Any) -> FloatArray:
        *of, axes = of_and_axes
        return np.asarray(board.forward_reading(method, axes, *of), dtype=np.float64)

    return _made(method, read)


def _words(method: Words) -> Words:
    """One that reads something else of each axis."""

    def read(board: ForwardedBoard, axes: AxisSelection) -> tuple[Any, ...]:
        return tuple(board.forward_reading(method, axes))

    return _made(method, read)


def _set_numbers(method: Order) -> Order:
    """One that gives each axis a number, with the kind of PID likewise."""

    def give(board: ForwardedBoard, *of_values_axes: Any) -> None:
        *of, values, axes = of_values_axes
        board.forward_setting(method, board.checked(values, len(board.chosen(axes))).tolist(), axes, *of)

    return _made(method, give)


def _set_modes(method: Order) -> Order:
    """One that gives each axis a mode: one for all of them, or one for each."""

    def give(board: ForwardedBoard, modes: ControlMode | Sequence[ControlMode], axes: AxisSelection) -> None:
        count = len(board.chosen(axes))
        try:
            wanted = modes_for(count, modes)
        except RefusedError as error:
            raise board.refusal(str(error)) from None
        board.forward_setting(method, wanted, axes)

    return _made(method, give)


def _done(method: Order) -> Order:
    """One that does something with axes."""

    def do(board: ForwardedBoard, axes: AxisSelection) -> None:
        board.forward_action(method, axes)

    return _made(method, do)


def _all_are(method: Truth) -> Truth:
    """One that says whether something is true of all these axes."""
    return _made(method, lambda board, axes: all(board.forward_action(method, axes)))


def _single(method: Method) -> Method:
    """One of a single axis, which is the first of its arguments."""

    def do(board: ForwardedBoard, axis: int, *arguments: Any) -> Any:
        [axis] = board.chosen(axis)
        return board.forward_single(method, axis, *arguments)

    return _made(method, do)


def _single_pid(method: Method) -> Method:
    """One of a single axis, before which the kind of PID goes."""

    def do(board: ForwardedBoard, kind: Any, axis: int, *arguments: Any) -> Any:
        [axis] = board.chosen(axis)
        return board.forward_single(method, axis, *arguments, of=(kind,))

    return _made(method, do)


def _whole(method: Method) -> Method:
    """One of the whole board."""
    return _made(method, lambda board: board.forward_whole(method))


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
    """All interfaces of a board; ``axes`` and the five below are what is left to say.

    They are given axes as they were chosen, None for all, and have to refuse those that the board does not have.
    """

    @abstractmethod
    def forward_reading(self, method: Plural, axes: AxisSelection, *of: object) -> Sequence[Any]:
        """What a plural method gives for these axes, one value for each. ``of`` goes before the axes: a kind of PID."""

    @abstractmethod
    def forward_setting(self, method: Plural, values: Sequence[Any], axes: AxisSelection, *of: object) -> None:
        """Have a plural method set these axes, which exist; there is a value for each."""

    @abstractmethod
    def forward_action(self, method: Plural, axes: AxisSelection) -> list[Any]:
        """Have a method do something for these axes; returns what it gave, of each call that was made of it."""

    @abstractmethod
    def forward_single(self, method: Callable[..., R], axis: int, *arguments: object, of: tuple[object, ...] = ()) -> R:
        """What a method gives of one axis, which exists. ``of`` goes before the axis, the arguments behind it."""

    @abstractmethod
    def forward_whole(self, method: Callable[..., R]) -> R:
        """What a method of the whole board gives."""

    # What is checked before anything is passed on -----------------------------------------------------------------

    def refusal(self, why: str) -> RefusedError:
        """What to raise for arguments that make no sense."""
        return RefusedError(why)

    def chosen(self, axes: AxisSelection) -> list[int]:
        """The numbers of axes. Raises RefusedError for one that the board does not have."""
        return selected(self.axes(), axes)

    def checked(self, values: Values, count: int) -> FloatArray:
        """So many finite numbers. Raises RefusedError for others."""
        return values_for(count, values)

    # The methods ----------------------------------------------------------------------------------------------------

    # Axes ------------------------------------------------------------------------------------------------------------

    axis_name = _single(IAxisInfo.axis_name)
    joint_type = _single(IAxisInfo.joint_type)

    # Encoders --------------------------------------------------------------------------------------------------------

    encoders = _numbers(IEncoders.encoders)
    encoder_speeds = _numbers(IEncoders.encoder_speeds)
    encoder_accelerations = _numbers(IEncoders.encoder_accelerations)
    encoder_times = _numbers(IEncoders.encoder_times)
    set_encoders = _set_numbers(IEncoders.set_encoders)
    reset_encoders = _done(IEncoders.reset_encoders)

    # Motors ----------------------------------------------------------------------------------------------------------

    def motor_encoder_count(self) -> int:
        """See IMotorEncoders: each axis has one."""
        return self.axes()

    motor_encoders = _numbers(IMotorEncoders.motor_encoders)
    motor_encoder_speeds = _numbers(IMotorEncoders.motor_encoder_speeds)
    motor_encoder_accelerations = _numbers(IMotorEncoders.motor_encoder_accelerations)
    set_motor_encoders = _set_numbers(IMotorEncoders.set_motor_encoders)
    reset_motor_encoders = _done(IMotorEncoders.reset_motor_encoders)
    counts_per_revolution = _single(IMotorEncoders.counts_per_revolution)
    set_counts_per_revolution = _single(IMotorEncoders.set_counts_per_revolution)

    def motor_count(self) -> int:
        """See IMotor: each axis has one."""
        return self.axes()

    temperatures = _numbers(IMotor.temperatures)
    temperature_limit = _single(IMotor.temperature_limit)
    set_temperature_limit = _single(IMotor.set_temperature_limit)
    gearbox_ratio = _single(IMotor.gearbox_ratio)
    set_gearbox_ratio = _single(IMotor.set_gearbox_ratio)

    # Moving ----------------------------------------------------------------------------------------------------------

    position_move = _set_numbers(IPositionControl.position_move)
    relative_move = _set_numbers(IPositionControl.relative_move)
    motion_done = _all_are(IPositionControl.motion_done)
    target_positions = _numbers(IPositionControl.target_positions)
    set_reference_speeds = _set_numbers(IPositionControl.set_reference_speeds)
    reference_speeds = _numbers(IPositionControl.reference_speeds)
    set_reference_accelerations = _set_numbers(IPositionControl.set_reference_accelerations)
    reference_accelerations = _numbers(IPositionControl.reference_accelerations)
    stop = _done(IPositionControl.stop)
    velocity_move = _set_numbers(IVelocityControl.velocity_move)
    target_velocities = _numbers(IVelocityControl.target_velocities)
    set_positions = _set_numbers(IPositionDirect.set_positions)
    reference_positions = _numbers(IPositionDirect.reference_positions)

    # Torques, impedances, currents and duty cycles -------------------------------------------------------------------

    torques = _numbers(ITorqueControl.torques)
    torque_range = _single(ITorqueControl.torque_range)
    set_reference_torques = _set_numbers(ITorqueControl.set_reference_torques)
    reference_torques = _numbers(ITorqueControl.reference_torques)
    motor_torque_parameters = _single(ITorqueControl.motor_torque_parameters)
    set_motor_torque_parameters = _single(ITorqueControl.set_motor_torque_parameters)
    impedance = _single(IImpedanceControl.impedance)
    set_impedance = _single(IImpedanceControl.set_impedance)
    impedance_offset = _single(IImpedanceControl.impedance_offset)
    set_impedance_offset = _single(IImpedanceControl.set_impedance_offset)
    impedance_limits = _single(IImpedanceControl.impedance_limits)
    currents = _numbers(ICurrentControl.currents)
    current_range = _single(ICurrentControl.current_range)
    set_reference_currents = _set_numbers(ICurrentControl.set_reference_currents)
    reference_currents = _numbers(ICurrentControl.reference_currents)
    set_reference_duty_cycles = _set_numbers(IPWMControl.set_reference_duty_cycles)
    reference_duty_cycles = _numbers(IPWMControl.reference_duty_cycles)
    duty_cycles = _numbers(IPWMControl.duty_cycles)

    # Modes, faults and limits ----------------------------------------------------------------------------------------

    control_modes = _words(IControlMode.control_modes)
    set_control_modes = _set_modes(IControlMode.set_control_modes)
    interaction_modes = _words(IInteractionMode.interaction_modes)
    set_interaction_modes = _set_modes(IInteractionMode.set_interaction_modes)
    last_joint_fault = _single(IJointFault.last_joint_fault)
    limits = _single(IControlLimits.limits)
    set_limits = _single(IControlLimits.set_limits)
    velocity_limits = _single(IControlLimits.velocity_limits)
    set_velocity_limits = _single(IControlLimits.set_velocity_limits)

    # Controllers -----------------------------------------------------------------------------------------------------

    pid = _single_pid(IPidControl.pid)
    set_pid = _single_pid(IPidControl.set_pid)

    def pid_count(self) -> int:
        """See IPidControl: each axis has one of each kind."""
        return self.axes()

    pid_references = _numbers(IPidControl.pid_references)
    set_pid_references = _set_numbers(IPidControl.set_pid_references)
    pid_errors = _numbers(IPidControl.pid_errors)
    pid_outputs = _numbers(IPidControl.pid_outputs)
    pid_error_limits = _numbers(IPidControl.pid_error_limits)
    set_pid_error_limits = _set_numbers(IPidControl.set_pid_error_limits)
    set_pid_offset = _single_pid(IPidControl.set_pid_offset)
    reset_pid = _single_pid(IPidControl.reset_pid)
    enable_pid = _single_pid(IPidControl.enable_pid)
    disable_pid = _single_pid(IPidControl.disable_pid)
    pid_enabled = _single_pid(IPidControl.pid_enabled)

    # Amplifiers ------------------------------------------------------------------------------------------------------

    enable_amplifier = _single(IAmplifierControl.enable_amplifier)
    disable_amplifier = _single(IAmplifierControl.disable_amplifier)
    amplifier_status = _words(IAmplifierControl.amplifier_status)
    max_current = _single(IAmplifierControl.max_current)
    set_max_current = _single(IAmplifierControl.set_max_current)
    nominal_current = _single(IAmplifierControl.nominal_current)
    set_nominal_current = _single(IAmplifierControl.set_nominal_current)
    peak_current = _single(IAmplifierControl.peak_current)
    set_peak_current = _single(IAmplifierControl.set_peak_current)
    pwm = _single(IAmplifierControl.pwm)
    pwm_limit = _single(IAmplifierControl.pwm_limit)
    set_pwm_limit = _single(IAmplifierControl.set_pwm_limit)
    supply_voltage = _single(IAmplifierControl.supply_voltage)

    # Calibration -----------------------------------------------------------------------------------------------------

    calibrate_axis = _single(IControlCalibration.calibrate_axis)
    set_calibration_parameters = _single(IControlCalibration.set_calibration_parameters)
    calibration_done = _single(IControlCalibration.calibration_done)
    has_calibrator = _whole(IRemoteCalibrator.has_calibrator)
    calibrate_joint = _single(IRemoteCalibrator.calibrate_joint)
    calibrate_part = _whole(IRemoteCalibrator.calibrate_part)
    home_joint = _single(IRemoteCalibrator.home_joint)
    home_part = _whole(IRemoteCalibrator.home_part)
    park_joint = _single(IRemoteCalibrator.park_joint)
    park_part = _whole(IRemoteCalibrator.park_part)
    quit_calibrate = _whole(IRemoteCalibrator.quit_calibrate)
    quit_park = _whole(IRemoteCalibrator.quit_park)
