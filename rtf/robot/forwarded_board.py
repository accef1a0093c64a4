"""A control board that forwards every method of every interface, through five methods of its subclass.

A client forwards them through the network, a remapper to other boards. The five methods get the interface's method as a
function object. Signatures are those of the interfaces, so calls are type-checked like those of any other board.
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
#: A method of an interface whose last argument selects axes.
Plural: TypeAlias = "Callable[..., Any]"
Method = TypeVar("Method", bound="Callable[..., Any]")
Numbers = TypeVar("Numbers", bound="Callable[..., FloatArray]")
Words = TypeVar("Words", bound="Callable[..., tuple[Any, ...]]")
Truth = TypeVar("Truth", bound="Callable[..., bool]")
Order = TypeVar("Order", bound="Callable[..., None]")


# Wrappers that turn a method of an interface into one of a forwarded board --------------------------------------------


def _made(method: Method, forward: Callable[..., Any]) -> Method:
    """Return a method that passes its arguments, in the interface's order, to ``forward``."""
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

    return cast("Method", update_wrapper(forwarded, method, updated=()))  # without the mark of an abstract method


def _numbers(method: Numbers) -> Numbers:
    """Wrap a method that reads a number of each axis. A PID type, if any, is before the axes."""

    def read(board: ForwardedBoard, *of_and_axes: Any) -> FloatArray:
        *of, axes = of_and_axes
        return np.asarray(board.forward_reading(method, axes, *of), dtype=np.float64)

    return _made(method, read)


def _words(method: Words) -> Words:
    """Wrap a method that reads another type of value of each axis."""

    def read(board: ForwardedBoard, axes: AxisSelection) -> tuple[Any, ...]:
        return tuple(board.forward_reading(method, axes))

    return _made(method, read)


def _set_numbers(method: Order) -> Order:
    """Wrap a method that sets a number of each axis. A PID type, if any, is the first argument."""

    def give(board: ForwardedBoard, *of_values_axes: Any) -> None:
        *of, values, axes = of_values_axes
        board.forward_setting(method, board.checked(values, len(board.chosen(axes))).tolist(), axes, *of)

    return _made(method, give)


def _set_modes(method: Order) -> Order:
    """Wrap a method that sets modes: one for all axes, or one for each."""

    def give(board: ForwardedBoard, modes: ControlMode | Sequence[ControlMode], axes: AxisSelection) -> None:
        count = len(board.chosen(axes))
        try:
            wanted = modes_for(count, modes)
        except RefusedError as error:
            raise board.refusal(str(error)) from None
        board.forward_setting(method, wanted, axes)

    return _made(method, give)


def _done(method: Order) -> Order:
    """Wrap a method that executes an action on axes."""

    def do(board: ForwardedBoard, axes: AxisSelection) -> None:
        board.forward_action(method, axes)

    return _made(method, do)


def _all_are(method: Truth) -> Truth:
    """Wrap a method that returns whether a condition holds for all selected axes."""
    return _made(method, lambda board, axes: all(board.forward_action(method, axes)))


def _single(method: Method) -> Method:
    """Wrap a method of a single axis, the first argument."""

    def do(board: ForwardedBoard, axis: int, *arguments: Any) -> Any:
        [axis] = board.chosen(axis)
        return board.forward_single(method, axis, *arguments)

    return _made(method, do)


def _single_pid(method: Method) -> Method:
    """Wrap a method of a single axis whose first argument is a PID type."""

    def do(board: ForwardedBoard, kind: Any, axis: int, *arguments: Any) -> Any:
        [axis] = board.chosen(axis)
        return board.forward_single(method, axis, *arguments, of=(kind,))

    return _made(method, do)


def _whole(method: Method) -> Method:
    """Wrap a method of the whole board."""
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
    """All interfaces of a board. Subclasses define ``axes`` and the five ``forward`` methods.

    These get the axes as they were selected, None for all, and must refuse axes that the board does not have.
    """

    @abstractmethod
    def forward_reading(self, method: Plural, axes: AxisSelection, *of: object) -> Sequence[Any]:
        """Return the values of a reading method, one for each axis. ``of``: arguments before the axes, a PID type."""

    @abstractmethod
    def forward_setting(self, method: Plural, values: Sequence[Any], axes: AxisSelection, *of: object) -> None:
        """Call a setting method for axes that exist, with one value for each."""

    @abstractmethod
    def forward_action(self, method: Plural, axes: AxisSelection) -> list[Any]:
        """Call an action for axes. Return the result of each call that was made for it."""

    @abstractmethod
    def forward_single(self, method: Callable[..., R], axis: int, *arguments: object, of: tuple[object, ...] = ()) -> R:
        """Return the result of a method for one existing axis. ``of``: arguments before the axis."""

    @abstractmethod
    def forward_whole(self, method: Callable[..., R]) -> R:
        """Return the result of a method of the whole board."""

    # Checks before forwarding -------------------------------------------------------------------------------------

    def refusal(self, why: str) -> RefusedError:
        """Return the error for invalid arguments."""
        return RefusedError(why)

    def chosen(self, axes: AxisSelection) -> list[int]:
        """Return the numbers of the selected axes. Raises RefusedError for one that the board does not have."""
        return selected(self.axes(), axes)

    def checked(self, values: Values, count: int) -> FloatArray:
        """Return the values as an array of ``count`` finite numbers. Raises RefusedError for others."""
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
        """Return the number of axes: each has one motor encoder."""
        return self.axes()

    motor_encoders = _numbers(IMotorEncoders.motor_encoders)
    motor_encoder_speeds = _numbers(IMotorEncoders.motor_encoder_speeds)
    motor_encoder_accelerations = _numbers(IMotorEncoders.motor_encoder_accelerations)
    set_motor_encoders = _set_numbers(IMotorEncoders.set_motor_encoders)
    reset_motor_encoders = _done(IMotorEncoders.reset_motor_encoders)
    counts_per_revolution = _single(IMotorEncoders.counts_per_revolution)
    set_counts_per_revolution = _single(IMotorEncoders.set_counts_per_revolution)

    def motor_count(self) -> int:
        """Return the number of axes: each has one motor."""
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
        """Return the number of axes: each has one PID of each type."""
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
