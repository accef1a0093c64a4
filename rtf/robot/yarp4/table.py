"""The service of YARP 4.0's control boards: all functions, in the order of the service.

One row per function: its name, the interface and the method that implement it, its arguments and its results. Both ends
use the table: the server finds the method by the name of the function, the client the function by the method.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Bottle
from rtf.robot.control_modes import REQUESTS
from rtf.robot.errors import NotSupportedError, RefusedError, RobotError
from rtf.robot.interfaces import (
    CalibrationParameters,
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
    IRemoteVariables,
    ITorqueControl,
    IVelocityControl,
    PidType,
)
from rtf.robot.yarp4 import functions as row
from rtf.robot.yarp4.functions import Message, Style
from rtf.robot.yarp4.values import (
    AXES,
    AXIS,
    AXIS16,
    BOTTLE,
    BOTTLES,
    CALIBRATION,
    INTERACTION,
    INTERACTIONS,
    JOINT_TYPE,
    MODE,
    MODES,
    NUMBER,
    NUMBERS,
    PID,
    PID_INFO,
    PID_INFOS,
    PID_TYPE,
    PID_TYPES,
    PIDS,
    TEXT,
    TORQUE_PARAMETERS,
    TRUTH,
    TRUTHS,
    WHOLE,
    WHOLES,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from rtf.robot.control_modes import ControlMode
    from rtf.robot.interfaces import FloatArray

#: The interfaces of a board by their names in the service; None: not available here.
INTERFACES: Mapping[str, type | None] = {
    "iAmplifierControl": IAmplifierControl,
    "iAxisInfo": IAxisInfo,
    "iControlCalibration": IControlCalibration,
    "iControlLimits": IControlLimits,
    "iControlMode": IControlMode,
    "iCurrentControl": ICurrentControl,
    "iEncodersTimed": IEncoders,
    "iImpedanceControl": IImpedanceControl,
    "iInteractionMode": IInteractionMode,
    "iJointBrake": None,
    "iJointFault": IJointFault,
    "iMotor": IMotor,
    "iMotorEncoders": IMotorEncoders,
    "iPWMControl": IPWMControl,
    "iPidControl": IPidControl,
    "iPositionControl": IPositionControl,
    "iPositionDirect": IPositionDirect,
    "iPreciselyTimed": None,
    "iRemoteCalibrator": IRemoteCalibrator,
    "iRemoteVariables": IRemoteVariables,
    "iTorqueControl": ITorqueControl,
    "iVelocityControl": IVelocityControl,
    "iVelocityDirect": None,
}


_PID_OF = (PID_TYPE, AXIS16)


# Functions with code of their own -------------------------------------------------------------------------------------


def _interfaces(board: object) -> dict[str, bool]:
    return {name: known is not None and isinstance(board, known) for name, known in INTERFACES.items()}


def _modes(_board: IControlMode, _joint: int) -> tuple[ControlMode, ...]:
    return REQUESTS


def _keys(board: IRemoteVariables) -> list[Bottle]:
    return [Bottle([key]) for key in board.variables()]


def _park_joint(board: IRemoteCalibrator, joint: int, _wait: bool) -> None:
    board.park_joint(joint)  # a device's call returns when it is done


def _park(board: IRemoteCalibrator, _wait: bool) -> None:
    board.park_part()


def _calibrate_axis(board: IControlCalibration, joint: int, kind: int, *parameters: float) -> None:
    board.calibrate_axis(joint, CalibrationParameters(kind, *parameters))


def _calibration_done(board: IControlCalibration, joint: int) -> None:
    if not board.calibration_done(joint):
        raise RefusedError(f"joint {joint} is not calibrated")


def _times(board: object, axes: int | None) -> FloatArray:
    if not isinstance(board, IEncoders):
        raise NotSupportedError(f"{type(board).__name__} has no times of its motor positions")
    return board.encoder_times(axes)


def _timed_encoder(board: IEncoders, joint: int) -> tuple[float, float]:
    return board.encoder(joint), board.encoder_times(joint)[0]


def _timed_encoders(board: IEncoders) -> tuple[FloatArray, FloatArray]:
    return board.encoders(), board.encoder_times()


def _timed_motor(board: IMotorEncoders, motor: int) -> tuple[float, float]:
    return board.motor_encoders(motor)[0], _times(board, motor)[0]


def _timed_motors(board: IMotorEncoders) -> tuple[FloatArray, FloatArray]:
    return board.motor_encoders(), _times(board, None)


def _current_ranges(board: ICurrentControl) -> tuple[list[float], list[float]]:
    return _apart(board.current_range(motor) for motor in range(len(board.currents())))


def _torque_ranges(board: ITorqueControl) -> tuple[list[float], list[float]]:
    return _apart(board.torque_range(joint) for joint in range(len(board.torques())))


def _apart(ranges: Iterable[tuple[float, float]]) -> tuple[list[float], list[float]]:
    """Return the minima and the maxima of ranges."""
    both = [*ranges]
    return [least for least, _ in both], [greatest for _, greatest in both]


def _available_pids(board: IPidControl, joint: int) -> list[PidType]:
    return [kind for kind in PidType if _has_pid(board, kind, joint)]


def _has_pid(board: IPidControl, kind: PidType, joint: int) -> bool:
    try:
        board.pid(kind, joint)
    except RobotError:
        return False
    return True


def _offset(board: IPidControl, kind: PidType, joint: int) -> float:
    return board.pid(kind, joint).offset


def _feedforward(board: IPidControl, kind: PidType, joint: int) -> float:
    return board.pid(kind, joint).feedforward


def _set_feedforward(board: IPidControl, kind: PidType, joint: int, feedforward: float) -> None:
    board.set_pid(kind, joint, board.pid(kind, joint)._replace(feedforward=feedforward))


# The service ----------------------------------------------------------------------------------------------------------

MESSAGES: tuple[Message, ...] = (
    row.own("getDeviceInterfacesRPC", object, _interfaces, gives=(TRUTHS,)),
    row.own("getAvailableControlModesRPC", IControlMode, _modes, takes=(AXIS16,), gives=(MODES,)),
    row.call("getImpedanceRPC", IImpedanceControl, "impedance", takes=(AXIS,), gives=(NUMBER, NUMBER)),
    row.call("setImpedanceRPC", IImpedanceControl, "set_impedance", takes=(AXIS, NUMBER, NUMBER)),
    row.call("setImpedanceOffsetRPC", IImpedanceControl, "set_impedance_offset", takes=(AXIS, NUMBER)),
    row.call("getImpedanceOffsetRPC", IImpedanceControl, "impedance_offset", takes=(AXIS,), gives=(NUMBER,)),
    row.call("getCurrentImpedanceLimitRPC", IImpedanceControl, "impedance_limits", takes=(AXIS,), gives=(NUMBER,) * 4),
    row.call("getLastJointFaultRPC", IJointFault, "last_joint_fault", takes=(AXIS,), gives=(WHOLE, TEXT)),
    row.call("getRemoteVariableRPC", IRemoteVariables, "variable", takes=(TEXT,), gives=(BOTTLE,)),
    row.call("setRemoteVariableRPC", IRemoteVariables, "set_variable", takes=(TEXT, BOTTLE)),
    row.own("getRemoteVariablesListRPC", IRemoteVariables, _keys, gives=(BOTTLES,)),
    row.one("getInteractionModeOneRPC", IInteractionMode, "interaction_modes", INTERACTION),
    row.some("getInteractionModesGroupRPC", IInteractionMode, "interaction_modes", INTERACTIONS),
    row.every("getInteractionModesAllRPC", IInteractionMode, "interaction_modes", INTERACTIONS),
    row.set_one("setInteractionModeOneRPC", IInteractionMode, "set_interaction_modes", INTERACTION),
    row.set_some("setInteractionModesGroupRPC", IInteractionMode, "set_interaction_modes", INTERACTIONS),
    row.set_every("setInteractionModesAllRPC", IInteractionMode, "set_interaction_modes", INTERACTIONS),
    row.every("getRefCurrentAllRPC", ICurrentControl, "reference_currents", NUMBERS),
    row.one("getRefCurrentOneRPC", ICurrentControl, "reference_currents", NUMBER),
    row.set_every("setRefCurrentAllRPC", ICurrentControl, "set_reference_currents", NUMBERS),
    row.set_one("setRefCurrentOneRPC", ICurrentControl, "set_reference_currents", NUMBER),
    row.set_some("setRefCurrentGroupRPC", ICurrentControl, "set_reference_currents", NUMBERS),
    row.every("getCurrentAllRPC", ICurrentControl, "currents", NUMBERS),
    row.one("getCurrentOneRPC", ICurrentControl, "currents", NUMBER),
    row.call("getCurrentRangeOneRPC", ICurrentControl, "current_range", takes=(AXIS,), gives=(NUMBER, NUMBER)),
    row.own("getCurrentRangeAllRPC", ICurrentControl, _current_ranges, gives=(NUMBERS, NUMBERS)),
    row.set_one("setRefDutyCycleOneRPC", IPWMControl, "set_reference_duty_cycles", NUMBER),
    row.set_every("setRefDutyCycleAllRPC", IPWMControl, "set_reference_duty_cycles", NUMBERS),
    row.set_some("setRefDutyCycleGroupRPC", IPWMControl, "set_reference_duty_cycles", NUMBERS),
    row.one("getRefDutyCycleOneRPC", IPWMControl, "reference_duty_cycles", NUMBER),
    row.every("getRefDutyCycleAllRPC", IPWMControl, "reference_duty_cycles", NUMBERS),
    row.one("getDutyCycleOneRPC", IPWMControl, "duty_cycles", NUMBER),
    row.every("getDutyCycleAllRPC", IPWMControl, "duty_cycles", NUMBERS),
    row.call("resetEncoderOneRPC", IEncoders, "reset_encoders", takes=(AXIS,), style=Style.ONE),
    row.call("resetEncoderAllRPC", IEncoders, "reset_encoders", style=Style.ALL),
    row.set_one("setEncoderOneRPC", IEncoders, "set_encoders", WHOLE),
    row.set_every("setEncoderAllRPC", IEncoders, "set_encoders", NUMBERS),
    row.one("getEncoderOneRPC", IEncoders, "encoders", NUMBER),
    row.own("getEncoderTimedOneRPC", IEncoders, _timed_encoder, takes=(AXIS,), gives=(NUMBER, NUMBER)),
    row.every("getEncoderAllRPC", IEncoders, "encoders", NUMBERS),
    row.own("getEncoderTimedAllRPC", IEncoders, _timed_encoders, gives=(NUMBERS, NUMBERS)),
    row.one("getEncoderSpeedOneRPC", IEncoders, "encoder_speeds", NUMBER),
    row.every("getEncoderSpeedAllRPC", IEncoders, "encoder_speeds", NUMBERS),
    row.one("getEncoderAccelerationOneRPC", IEncoders, "encoder_accelerations", NUMBER),
    row.every("getEncoderAccelerationAllRPC", IEncoders, "encoder_accelerations", NUMBERS),
    row.call("resetMotorEncoderRPC", IMotorEncoders, "reset_motor_encoders", takes=(AXIS,), style=Style.ONE),
    row.call("resetMotorEncodersRPC", IMotorEncoders, "reset_motor_encoders", style=Style.ALL),
    row.set_one("setMotorEncoderRPC", IMotorEncoders, "set_motor_encoders", NUMBER),
    row.call(
        "setMotorEncoderCountsPerRevolutionRPC", IMotorEncoders, "set_counts_per_revolution", takes=(AXIS, NUMBER)
    ),
    row.call(
        "getMotorEncoderCountsPerRevolutionRPC", IMotorEncoders, "counts_per_revolution", takes=(AXIS,), gives=(NUMBER,)
    ),
    row.set_every("setMotorEncodersAllRPC", IMotorEncoders, "set_motor_encoders", NUMBERS),
    row.one("getMotorEncoderOneRPC", IMotorEncoders, "motor_encoders", NUMBER),
    row.every("getMotorEncoderAllRPC", IMotorEncoders, "motor_encoders", NUMBERS),
    row.own("getMotorEncoderTimedOneRPC", IMotorEncoders, _timed_motor, takes=(AXIS,), gives=(NUMBER, NUMBER)),
    row.own("getMotorEncodersTimedAllRPC", IMotorEncoders, _timed_motors, gives=(NUMBERS, NUMBERS)),
    row.one("getMotorEncoderSpeedOneRPC", IMotorEncoders, "motor_encoder_speeds", NUMBER),
    row.every("getMotorEncoderSpeedAllRPC", IMotorEncoders, "motor_encoder_speeds", NUMBERS),
    row.one("getMotorEncoderAccelerationOneRPC", IMotorEncoders, "motor_encoder_accelerations", NUMBER),
    row.every("getMotorEncoderAccelerationAllRPC", IMotorEncoders, "motor_encoder_accelerations", NUMBERS),
    row.call("getNumberOfMotorEncodersRPC", IMotorEncoders, "motor_encoder_count", gives=(WHOLE,)),
    row.call("isCalibratorDevicePresentRPC", IRemoteCalibrator, "has_calibrator", gives=(TRUTH,)),
    row.call("calibrateSingleJointRPC", IRemoteCalibrator, "calibrate_joint", takes=(AXIS,)),
    row.call("calibrateWholePartRPC", IRemoteCalibrator, "calibrate_part"),
    row.call("homingSingleJointRPC", IRemoteCalibrator, "home_joint", takes=(AXIS,)),
    row.call("homingWholePartRPC", IRemoteCalibrator, "home_part"),
    row.own("parkSingleJointRPC", IRemoteCalibrator, _park_joint, takes=(AXIS, TRUTH)),
    row.call("parkWholePartRPC", IRemoteCalibrator, "park_part"),
    row.call("quitCalibrateRPC", IRemoteCalibrator, "quit_calibrate"),
    row.call("quitParkRPC", IRemoteCalibrator, "quit_park"),
    row.absent("setManualBrakeActiveRPC", takes=(AXIS, TRUTH)),
    row.absent("setAutoBrakeEnabledRPC", takes=(AXIS, TRUTH)),
    row.absent("isJointBrakedRPC", takes=(AXIS,), gives=(TRUTH,)),
    row.absent("getAutoBrakeEnabledRPC", takes=(AXIS,), gives=(TRUTH,)),
    row.call("getAxesRPC", IAxisInfo, "axes", gives=(WHOLE,)),
    row.one("getRefTorqueOneRPC", ITorqueControl, "reference_torques", NUMBER),
    row.every("getRefTorqueAllRPC", ITorqueControl, "reference_torques", NUMBERS),
    row.some("getRefTorqueGroupRPC", ITorqueControl, "reference_torques", NUMBERS),
    row.set_one("setRefTorqueOneRPC", ITorqueControl, "set_reference_torques", NUMBER),
    row.set_every("setRefTorqueAllRPC", ITorqueControl, "set_reference_torques", NUMBERS),
    row.set_some("setRefTorqueGroupRPC", ITorqueControl, "set_reference_torques", NUMBERS),
    row.set_one("setRefPositionOneRPC", IPositionDirect, "set_positions", NUMBER),
    row.set_every("setRefPositionAllRPC", IPositionDirect, "set_positions", NUMBERS),
    row.set_some("setRefPositionGroupRPC", IPositionDirect, "set_positions", NUMBERS),
    row.one("getRefPositionOneRPC", IPositionDirect, "reference_positions", NUMBER),
    row.every("getRefPositionAllRPC", IPositionDirect, "reference_positions", NUMBERS),
    row.some("getRefPositionGroupRPC", IPositionDirect, "reference_positions", NUMBERS),
    row.set_one("setControlModeOneRPC", IControlMode, "set_control_modes", MODE),
    row.set_every("setControlModeAllRPC", IControlMode, "set_control_modes", MODES),
    row.set_some("setControlModeGroupRPC", IControlMode, "set_control_modes", MODES),
    row.call("getAxisNameRPC", IAxisInfo, "axis_name", takes=(AXIS,), gives=(TEXT,)),
    row.call("getJointTypeRPC", IAxisInfo, "joint_type", takes=(AXIS,), gives=(JOINT_TYPE,)),
    row.call("calibrateRobotRPC", IRemoteCalibrator, "calibrate_part"),
    row.call("abortCalibrationRPC", IRemoteCalibrator, "quit_calibrate"),
    row.call("abortParkRPC", IRemoteCalibrator, "quit_park"),
    row.own("parkRPC", IRemoteCalibrator, _park, takes=(TRUTH,)),
    row.own("calibrateAxisWithParamsRPC", IControlCalibration, _calibrate_axis, takes=(AXIS, WHOLE, *(NUMBER,) * 3)),
    row.call(
        "setCalibrationParametersRPC", IControlCalibration, "set_calibration_parameters", takes=(AXIS, CALIBRATION)
    ),
    row.own("calibrationDoneRPC", IControlCalibration, _calibration_done, takes=(AXIS,)),
    row.call("setPosLimitsRPC", IControlLimits, "set_limits", takes=(AXIS16, NUMBER, NUMBER)),
    row.call("setVelLimitsRPC", IControlLimits, "set_velocity_limits", takes=(AXIS16, NUMBER, NUMBER)),
    row.call("getPosLimitsRPC", IControlLimits, "limits", takes=(AXIS16,), gives=(NUMBER, NUMBER)),
    row.call("getVelLimitsRPC", IControlLimits, "velocity_limits", takes=(AXIS16,), gives=(NUMBER, NUMBER)),
    row.call("getNumberOfMotorsRPC", IMotor, "motor_count", gives=(WHOLE,)),
    row.one("getTemperatureOneRPC", IMotor, "temperatures", NUMBER),
    row.every("getTemperatureAllRPC", IMotor, "temperatures", NUMBERS),
    row.call("getTemperatureLimitRPC", IMotor, "temperature_limit", takes=(AXIS,), gives=(NUMBER,)),
    row.call("setTemperatureLimitRPC", IMotor, "set_temperature_limit", takes=(AXIS, NUMBER)),
    row.call("getGearboxRatioRPC", IMotor, "gearbox_ratio", takes=(AXIS,), gives=(NUMBER,)),
    row.call("setGearboxRatioRPC", IMotor, "set_gearbox_ratio", takes=(AXIS, NUMBER)),
    row.call("enablePidRPC", IPidControl, "enable_pid", takes=_PID_OF),
    row.call("disablePidRPC", IPidControl, "disable_pid", takes=_PID_OF),
    row.call("resetPidRPC", IPidControl, "reset_pid", takes=_PID_OF),
    row.call("setPidRPC", IPidControl, "set_pid", takes=(*_PID_OF, PID)),
    row.call("setPidsRPC", IPidControl, "set_pids", takes=(PID_TYPE, PIDS)),
    row.call("setPidOffsetOneRPC", IPidControl, "set_pid_offset", takes=(*_PID_OF, NUMBER)),
    row.own("setPidFeedforwardOneRPC", IPidControl, _set_feedforward, takes=(*_PID_OF, NUMBER)),
    row.set_one("setPidReferenceRPC", IPidControl, "set_pid_references", NUMBER, of=_PID_OF),
    row.set_every("setPidReferencesRPC", IPidControl, "set_pid_references", NUMBERS, of=(PID_TYPE,)),
    row.set_one("setPidErrorLimitRPC", IPidControl, "set_pid_error_limits", NUMBER, of=_PID_OF),
    row.set_every("setPidErrorLimitsRPC", IPidControl, "set_pid_error_limits", NUMBERS, of=(PID_TYPE,)),
    row.own("getAvailablePidsRPC", IPidControl, _available_pids, takes=(AXIS16,), gives=(PID_TYPES,)),
    row.call("isPidEnabledRPC", IPidControl, "pid_enabled", takes=_PID_OF, gives=(TRUTH,)),
    row.one("getPidErrorRPC", IPidControl, "pid_errors", NUMBER, of=_PID_OF),
    row.every("getPidErrorsRPC", IPidControl, "pid_errors", NUMBERS, of=(PID_TYPE,)),
    row.one("getPidReferenceRPC", IPidControl, "pid_references", NUMBER, of=_PID_OF),
    row.every("getPidReferencesRPC", IPidControl, "pid_references", NUMBERS, of=(PID_TYPE,)),
    row.one("getPidErrorLimitRPC", IPidControl, "pid_error_limits", NUMBER, of=_PID_OF),
    row.every("getPidErrorLimitsRPC", IPidControl, "pid_error_limits", NUMBERS, of=(PID_TYPE,)),
    row.one("getPidOutputRPC", IPidControl, "pid_outputs", NUMBER, of=_PID_OF),
    row.every("getPidOutputsRPC", IPidControl, "pid_outputs", NUMBERS, of=(PID_TYPE,)),
    row.call("getPidRPC", IPidControl, "pid", takes=_PID_OF, gives=(PID,)),
    row.call("getPidsRPC", IPidControl, "pids", takes=(PID_TYPE,), gives=(PIDS,)),
    row.absent("getPidExtraInfoRPC", takes=_PID_OF, gives=(PID_INFO,)),
    row.absent("getPidExtraInfosRPC", takes=(PID_TYPE,), gives=(PID_INFOS,)),
    row.own("getPidOffsetRPC", IPidControl, _offset, takes=_PID_OF, gives=(NUMBER,)),
    row.own("getPidFeedforwardRPC", IPidControl, _feedforward, takes=_PID_OF, gives=(NUMBER,)),
    row.set_one("positionMoveOneRPC", IPositionControl, "position_move", NUMBER),
    row.set_some("positionMoveGroupRPC", IPositionControl, "position_move", NUMBERS),
    row.set_every("positionMoveAllRPC", IPositionControl, "position_move", NUMBERS),
    row.set_one("relativeMoveOneRPC", IPositionControl, "relative_move", NUMBER),
    row.set_some("relativeMoveGroupRPC", IPositionControl, "relative_move", NUMBERS),
    row.set_every("relativeMoveAllRPC", IPositionControl, "relative_move", NUMBERS),
    row.set_one("setTrajSpeedOneRPC", IPositionControl, "set_reference_speeds", NUMBER),
    row.set_some("setTrajSpeedGroupRPC", IPositionControl, "set_reference_speeds", NUMBERS),
    row.set_every("setTrajSpeedAllRPC", IPositionControl, "set_reference_speeds", NUMBERS),
    row.set_one("setTrajAccelerationOneRPC", IPositionControl, "set_reference_accelerations", NUMBER),
    row.set_some("setTrajAccelerationsGroupRPC", IPositionControl, "set_reference_accelerations", NUMBERS),
    row.set_every("setTrajAccelerationsAllRPC", IPositionControl, "set_reference_accelerations", NUMBERS),
    row.call("stopOneRPC", IPositionControl, "stop", takes=(AXIS,), style=Style.ONE),
    row.call("stopGroupRPC", IPositionControl, "stop", takes=(AXES,), style=Style.SOME),
    row.call("stopAllRPC", IPositionControl, "stop", style=Style.ALL),
    row.one("getTargetPositionOneRPC", IPositionControl, "target_positions", NUMBER),
    row.some("getTargetPositionGroupRPC", IPositionControl, "target_positions", NUMBERS),
    row.every("getTargetPositionAllRPC", IPositionControl, "target_positions", NUMBERS),
    row.one("getTrajSpeedOneRPC", IPositionControl, "reference_speeds", NUMBER),
    row.some("getTrajSpeedsGroupRPC", IPositionControl, "reference_speeds", NUMBERS),
    row.every("getTrajSpeedsAllRPC", IPositionControl, "reference_speeds", NUMBERS),
    row.one("getTrajAccelerationOneRPC", IPositionControl, "reference_accelerations", NUMBER),
    row.some("getTrajAccelerationGroupRPC", IPositionControl, "reference_accelerations", NUMBERS),
    row.every("getTrajAccelerationAllRPC", IPositionControl, "reference_accelerations", NUMBERS),
    row.call("checkMotionDoneOneRPC", IPositionControl, "motion_done", takes=(AXIS,), gives=(TRUTH,), style=Style.ONE),
    row.call(
        "checkMotionDoneGroupRPC", IPositionControl, "motion_done", takes=(AXES,), gives=(TRUTH,), style=Style.SOME
    ),
    row.call("checkMotionDoneAllRPC", IPositionControl, "motion_done", gives=(TRUTH,), style=Style.ALL),
    row.set_one("velocityMoveOneRPC", IVelocityControl, "velocity_move", NUMBER),
    row.set_some("velocityMoveGroupRPC", IVelocityControl, "velocity_move", NUMBERS),
    row.set_every("velocityMoveAllRPC", IVelocityControl, "velocity_move", NUMBERS),
    row.one("getTargetVelocityOneRPC", IVelocityControl, "target_velocities", NUMBER),
    row.some("getTargetVelocityGroupRPC", IVelocityControl, "target_velocities", NUMBERS),
    row.every("getTargetVelocityAllRPC", IVelocityControl, "target_velocities", NUMBERS),
    row.absent("setRefVelocityOneRPC", takes=(AXIS, NUMBER)),
    row.absent("setRefVelocityAllRPC", takes=(NUMBERS,)),
    row.absent("setRefVelocityGroupRPC", takes=(AXES, NUMBERS)),
    row.absent("getRefVelocityOneRPC", takes=(AXIS,), gives=(NUMBER,)),
    row.absent("getRefVelocityAllRPC", gives=(NUMBERS,)),
    row.absent("getRefVelocityGroupRPC", takes=(AXES,), gives=(NUMBERS,)),
    row.call("getTorqueRangeOneRPC", ITorqueControl, "torque_range", takes=(AXIS,), gives=(NUMBER, NUMBER)),
    row.own("getTorqueRangeAllRPC", ITorqueControl, _torque_ranges, gives=(NUMBERS, NUMBERS)),
    row.call("setMotorTorqueParamsRPC", ITorqueControl, "set_motor_torque_parameters", takes=(AXIS, TORQUE_PARAMETERS)),
    row.call(
        "getMotorTorqueParamsRPC", ITorqueControl, "motor_torque_parameters", takes=(AXIS,), gives=(TORQUE_PARAMETERS,)
    ),
    row.call("enableAmpRPC", IAmplifierControl, "enable_amplifier", takes=(AXIS,)),
    row.call("disableAmpRPC", IAmplifierControl, "disable_amplifier", takes=(AXIS,)),
    row.every("getAmpStatusAllRPC", IAmplifierControl, "amplifier_status", WHOLES),
    row.one("getAmpStatusOneRPC", IAmplifierControl, "amplifier_status", WHOLE),
    row.call("setMaxCurrentRPC", IAmplifierControl, "set_max_current", takes=(AXIS, NUMBER)),
    row.call("getMaxCurrentRPC", IAmplifierControl, "max_current", takes=(AXIS,), gives=(NUMBER,)),
    row.call("getNominalCurrentRPC", IAmplifierControl, "nominal_current", takes=(AXIS,), gives=(NUMBER,)),
    row.call("setNominalCurrentRPC", IAmplifierControl, "set_nominal_current", takes=(AXIS, NUMBER)),
    row.call("getPeakCurrentRPC", IAmplifierControl, "peak_current", takes=(AXIS,), gives=(NUMBER,)),
    row.call("setPeakCurrentRPC", IAmplifierControl, "set_peak_current", takes=(AXIS, NUMBER)),
    row.call("getPWMRPC", IAmplifierControl, "pwm", takes=(AXIS,), gives=(NUMBER,)),
    row.call("getPWMLimitRPC", IAmplifierControl, "pwm_limit", takes=(AXIS,), gives=(NUMBER,)),
    row.call("setPWMLimitRPC", IAmplifierControl, "set_pwm_limit", takes=(AXIS, NUMBER)),
    row.call("getPowerSupplyVoltageRPC", IAmplifierControl, "supply_voltage", takes=(AXIS,), gives=(NUMBER,)),
)

#: The functions by their names.
BY_NAME: Mapping[str, Message] = {message.name: message for message in MESSAGES}
#: The name of each interface in the service.
INTERFACE_NAMES: Mapping[type, str] = {known: name for name, known in INTERFACES.items() if known is not None}
#: The functions by method and style: ``BY_METHOD["encoders", Style.ONE]``.
BY_METHOD: Mapping[tuple[str, Style], Message] = {
    (message.method, message.style): message for message in reversed(MESSAGES) if message.method
}

#: Functions whose result type has another name than the function.
_RESULTS = {
    "getInteractionModesGroupRPC": "getInteractionModeGroup",
    "getInteractionModesAllRPC": "getInteractionModeAll",
    "getMotorEncodersTimedAllRPC": "getMotorEncoderTimedAll",
}
#: Reading functions that are not declared const.
_CHANGING = frozenset({"getAxisNameRPC", "getJointTypeRPC", "getMotorTorqueParamsRPC"})


def prototype(message: Message) -> str:
    """Return the prototype of a function, which tools show."""
    result = (
        f"return_{_RESULTS.get(message.name, message.name.removesuffix('RPC'))}"
        if message.gives
        else "yarp::dev::ReturnValue"
    )
    constant = " const" if message.gives and message.name not in _CHANGING else ""
    arguments = ", ".join(kind.cpp for kind in message.takes)
    return f"{result} ControlBoardMsgs::{message.name}({arguments}){constant}"
