"""The messages of boards that control joints, and of boards that drive motors.

A ``tick`` is a count of an encoder. Speeds of velocity moves are in ticks/ms times 2 to the power of the velocity
shift, which ``VELOCITY_SHIFT`` sets; broadcast speeds have the shift of ``ESTIMATOR_SHIFTS``. Duty cycles, torques and
outputs of controllers are counts of the board.
"""

from __future__ import annotations

from functools import partial

from rtf.robot.devices.can.codes import (
    BoardInteraction,
    BoardMode,
    BoardState,
    BoardType,
    CalibrationType,
    CanState,
    FocFault,
    FocPidParameter,
    FocPidType,
    JointFault,
    MotorFlag,
    QuadratureState,
)
from rtf.robot.devices.can.messages import (
    Dialect,
    Field,
    Message,
    MessageClass,
    code,
    f16,
    f32,
    flags,
    i16,
    i32,
    messages_of,
    pad,
    question,
    setting,
    text,
    u8,
)

_JOINT, _FOC = Dialect.JOINT, Dialect.FOC
_command = partial(Message, MessageClass.MOTOR_POLLING)
_question = partial(question, MessageClass.MOTOR_POLLING)
_setting = partial(setting, MessageClass.MOTOR_POLLING)


def _periodic(number: int, name: str, *layout: Field, dialect: Dialect, about: str = "") -> Message:
    return Message(MessageClass.MOTOR_PERIODIC, number, name, layout, dialect=dialect, about=about)


_PID = (i16("kp"), i16("ki"), i16("kd"), u8("shift"))
_LIMITS = (i16("offset"), i16("output_limit"), i16("integral_limit"))
_TICKS = i32("position", "tick")

# Both kinds of boards --------------------------------------------------------------------------------------------

VERSION = _question(
    91,
    "version",
    code("board_type", BoardType),
    u8("firmware_major"),
    u8("firmware_minor"),
    u8("firmware_build"),
    u8("protocol_major"),
    u8("protocol_minor"),
    u8("acknowledged"),
    request=(u8("protocol_major"), u8("protocol_minor")),
    about="acknowledged: 1 if the major version is equal and the minor one at least that asked for",
)
SET_CONTROL_MODE = _command(9, "set_control_mode", (code("mode", BoardMode),))
CONTROL_MODE = _question(7, "control_mode", code("mode", BoardMode), pad(), dialect=_JOINT)
FOC_CONTROL_MODE = _question(7, "foc_control_mode", code("mode", BoardMode), dialect=_FOC)
BOARD_ID = _setting((50, 51), "board_id", u8("address"))
POSITION_PID = _setting(
    (82, 83), "position_pid", *_PID, about="a gain is its number divided by 2 to the power of shift"
)
CURRENT_LIMIT = _command(72, "set_current_limit", (i32("peak", "A", 0.001),))

# Boards that control joints --------------------------------------------------------------------------------------

CALIBRATE = _command(
    4,
    "calibrate",
    (code("type", CalibrationType), i16("parameter_1"), i16("parameter_2"), i16("parameter_3")),
    dialect=_JOINT,
)
MOTION_DONE = _question(8, "motion_done", i16("done"), dialect=_JOINT)
WRITE_FLASH = _command(10, "write_flash", dialect=_JOINT)
READ_FLASH = _command(11, "read_flash", dialect=_JOINT)
INFORMATION = _setting(
    (13, 12), "information", u8("block"), text("text", 4, 4), dialect=_JOINT, about="eight blocks, and so many answers"
)
ESTIMATOR_SHIFTS = _command(
    14,
    "set_estimator_shifts",
    (u8("joint_velocity"), u8("joint_acceleration"), u8("motor_velocity"), u8("motor_acceleration")),
    dialect=_JOINT,
)
ENCODER = _question(20, "encoder", _TICKS, i16("speed", "tick/ms<<shift"), dialect=_JOINT)
DESIRED_POSITION = _setting((21, 22), "desired_position", _TICKS, dialect=_JOINT)
DESIRED_VELOCITY = _setting((23, 24), "desired_velocity", i16("speed", "tick/ms<<shift"), dialect=_JOINT)
DESIRED_ACCELERATION = _setting(
    (25, 26), "desired_acceleration", i16("acceleration", "tick/ms^2<<shift"), dialect=_JOINT
)
POSITION_MOVE = _command(
    27,
    "position_move",
    (i32("target", "tick"), i16("speed", "tick/s", 10.0)),
    dialect=_JOINT,
    about="a minimum-jerk trajectory of 100 * |distance| / speed ms with the numbers as sent, at least 1 ms",
)
VELOCITY_MOVE = _command(
    28,
    "velocity_move",
    (i16("speed", "tick/ms<<shift"), i16("acceleration", "tick/ms^2<<shift")),
    dialect=_JOINT,
    about="renews the watchdog of velocities",
)
SET_ENCODER = _command(29, "set_encoder", (_TICKS,), dialect=_JOINT, about="boards of four axes only")
P_GAIN = _setting((30, 31), "p_gain", i16("gain"), dialect=_JOINT)
D_GAIN = _setting((32, 33), "d_gain", i16("gain"), dialect=_JOINT)
I_GAIN = _setting((34, 35), "i_gain", i16("gain"), dialect=_JOINT)
INTEGRAL_LIMIT = _setting((36, 37), "integral_limit", i16("limit"), dialect=_JOINT)
OUTPUT_OFFSET = _setting((38, 39), "output_offset", i16("offset"), dialect=_JOINT)
GAIN_SCALE = _setting((40, 41), "gain_scale", i16("scale"), dialect=_JOINT)
OUTPUT_LIMIT = _setting((42, 43), "output_limit", i16("limit"), dialect=_JOINT)
DESIRED_TORQUE = _setting((44, 45), "desired_torque", i32("torque"), dialect=_JOINT)
STOP = _command(46, "stop", dialect=_JOINT, about="holds the present position")
PWM_LIMIT = _setting((47, 48), "pwm_limit", i16("limit"), dialect=_JOINT)
TORQUE_SOURCE = _command(52, "set_torque_source", (u8("strain_board"), u8("channel"), pad(5)), dialect=_JOINT)
PID_ERROR = _question(55, "pid_error", i16("error"), dialect=_JOINT)
CALIBRATION_STATUS = _question(
    56,
    "calibration_status",
    u8("calibrated"),
    code("mode", BoardMode),
    code("interaction", BoardInteraction),
    dialect=_JOINT,
)
POSITION_REFERENCE = _question(57, "position_reference", _TICKS, dialect=_JOINT)
VELOCITY_REFERENCE = _question(58, "velocity_reference", i16("speed", "tick/ms<<shift"), dialect=_JOINT)
ERROR_STATUS = _question(60, "error_status", u8("error"), pad(), dialect=_JOINT)
ENCODER_SPEED = _question(61, "encoder_speed", i16("speed", "tick/ms<<shift"), dialect=_JOINT)
COMMAND_POSITION = _command(62, "command_position", (_TICKS,), dialect=_JOINT, about="without a trajectory")
PID_OUTPUT = _question(63, "pid_output", i16("output"), dialect=_JOINT)
MIN_POSITION = _setting((64, 65), "min_position", _TICKS, dialect=_JOINT)
MAX_POSITION = _setting((66, 67), "max_position", _TICKS, dialect=_JOINT)
MAX_VELOCITY = _setting((68, 69), "max_velocity", i16("speed", "tick/ms<<shift"), dialect=_JOINT)
BROADCASTS = _command(
    73, "set_broadcasts", (Field("mask", "I"),), dialect=_JOINT, about="bit t - 1 enables the periodic type t"
)
VELOCITY_SHIFT = _command(74, "set_velocity_shift", (i16("shift"),), dialect=_JOINT)
ENCODER_OFFSET = _setting((75, 76), "encoder_offset", i32("offset"), dialect=_JOINT)
TORQUE_PID = _setting((78, 79), "torque_pid", *_PID, dialect=_JOINT)
TORQUE_LIMITS = _setting((80, 81), "torque_limits", *_LIMITS, pad(), dialect=_JOINT)
POSITION_LIMITS = _setting((84, 85), "position_limits", *_LIMITS, pad(), dialect=_JOINT)
VELOCITY_TIMEOUT = _command(86, "set_velocity_timeout", (i16("timeout", "s", 0.001),), dialect=_JOINT)
IMPEDANCE = _setting((87, 88), "impedance", i16("stiffness"), i16("damping"), i16("offset"), pad(), dialect=_JOINT)
IMPEDANCE_OFFSET = _setting((89, 90), "impedance_offset", i16("offset"), dialect=_JOINT)
POSITION_STICTION = _setting((93, 94), "position_stiction", i16("up"), i16("down"), dialect=_JOINT)
TORQUE_STICTION = _setting((95, 96), "torque_stiction", i16("up"), i16("down"), dialect=_JOINT)
MOTOR_PARAMETERS = _setting(
    (97, 98), "motor_parameters", i16("bemf"), u8("bemf_shift"), i16("ktau"), u8("ktau_shift"), pad(), dialect=_JOINT
)
MODEL_PARAMETERS = _setting((99, 100), "model_parameters", i16("kff"), u8("shift"), pad(4), dialect=_JOINT)
OPEN_LOOP = _setting((114, 115), "open_loop", i16("pwm"), dialect=_JOINT)
SET_INTERACTION = _command(116, "set_interaction", (code("mode", BoardInteraction),), dialect=_JOINT)
INTERACTION = _question(117, "interaction", code("mode", BoardInteraction), pad(), dialect=_JOINT)


def _pair(name: str, unit: str = "") -> tuple[Field, Field]:
    return i16(f"{name}_0", unit), i16(f"{name}_1", unit)


BROADCAST_POSITION = _periodic(1, "position", i32("position_0", "tick"), i32("position_1", "tick"), dialect=_JOINT)
BROADCAST_PID = _periodic(2, "pid_value", *_pair("output"), *_pair("pwm"), dialect=_JOINT)
STATUS = _periodic(
    3,
    "status",
    flags("faults_0", JointFault),
    code("mode_0", BoardMode),
    flags("faults_1", JointFault),
    code("mode_1", BoardMode),
    flags("can_state", CanState),
    flags("board_state", BoardState),
    u8("tx_errors"),
    u8("rx_errors"),
    dialect=_JOINT,
    about="after a change, and at least every 5 s",
)
BROADCAST_CURRENT = _periodic(4, "current", *_pair("current"), pad(4), dialect=_JOINT)
OVERFLOW = _periodic(5, "overflow", text("data", 0, 8), dialect=_JOINT)
PRINT = _periodic(
    6,
    "print",
    u8("kind"),
    u8("part"),
    text("text", 0, 6),
    dialect=Dialect.BOTH,
    about="kind: 6, or 134 for the last part; part: the number of the text times 16, and that of the part",
)
BROADCAST_VELOCITY = _periodic(
    7,
    "velocity",
    *_pair("speed", "tick/ms<<shift"),
    *_pair("acceleration", "tick/ms^2<<shift"),
    dialect=_JOINT,
)
BROADCAST_ERROR = _periodic(8, "pid_errors", *_pair("position_error"), *_pair("torque_error"), dialect=_JOINT)
DEBUG = _periodic(9, "debug", i16("value_0"), i16("value_1"), i16("value_2"), i16("value_3"), dialect=_JOINT)
MOTOR_POSITION = _periodic(10, "motor_position", i32("position_0", "tick"), i32("position_1", "tick"), dialect=_JOINT)
MOTOR_SPEED = _periodic(
    11,
    "motor_speed",
    *_pair("speed", "tick/ms<<shift"),
    *_pair("acceleration", "tick/ms^2<<shift"),
    dialect=_JOINT,
)
ADDITIONAL_STATUS = _periodic(
    12,
    "additional_status",
    u8("interaction"),
    dialect=_JOINT,
    about="axis 0 in the low four bits, axis 1 in the high ones",
)

# Boards that drive a motor ---------------------------------------------------------------------------------------

MOTOR_PARAMETER = _setting(
    (1, 2), "motor_parameter", u8("parameter"), f32("value"), request=(u8("parameter"),), dialect=_FOC,
    about="1: back-EMF, 3: greatest speed",
)  # fmt: skip
SET_HALL = _command(1, "set_hall", (u8("parameter"), Field("offset", "H"), u8("swapped")), dialect=_FOC)
HALL = Message(
    MessageClass.MOTOR_POLLING,
    2,
    "hall",
    (u8("parameter"), Field("offset", "H"), u8("swapped")),
    reply=True,
    dialect=_FOC,
    about="the answer to get_motor_parameter 2",
)
TARGET_POSITION = _setting(
    (5, 6),
    "target_position",
    u8("parameter"),
    f32("position"),
    f16("velocity"),
    request=(u8("parameter"),),
    dialect=_FOC,
)
CURRENT_LIMITS = _setting(
    (72, 124),
    "current_limits",
    pad(),
    i16("nominal", "A", 0.001),
    i16("peak", "A", 0.001),
    i16("overload", "A", 0.001),
    dialect=_FOC,
)
CURRENT_PID = _setting((101, 102), "current_pid", *_PID, dialect=_FOC)
CURRENT_PID_LIMITS = _setting((103, 104), "current_pid_limits", *_LIMITS, dialect=_FOC)
VELOCITY_PID = _setting((105, 106), "velocity_pid", *_PID, dialect=_FOC, about="gains in mA")
VELOCITY_PID_LIMITS = _setting((107, 108), "velocity_pid_limits", *_LIMITS, dialect=_FOC)
FOC_POSITION_LIMITS = _setting((84, 85), "foc_position_limits", *_LIMITS, dialect=_FOC)
DESIRED_CURRENT = _setting((109, 110), "desired_current", i16("current", "A", 0.001), pad(2), dialect=_FOC)
MOTOR_CONFIGURATION = _setting(
    (119, 123),
    "motor_configuration",
    flags("flags", MotorFlag),
    i16("resolution"),
    i16("index_offset"),
    u8("poles"),
    u8("tolerance", "deg", 0.1),
    dialect=_FOC,
)
TEMPERATURE_LIMIT = _setting((121, 122), "temperature_limit", i16("limit"), dialect=_FOC)
FOC_PID_PARAMETER = _setting(
    (125, 126),
    "foc_pid_parameter",
    code("controller", FocPidType),
    code("parameter", FocPidParameter),
    pad(),
    f32("value"),
    request=(code("controller", FocPidType), code("parameter", FocPidParameter)),
    dialect=_FOC,
)
#: The setpoints for the boards 1 to n, by n - 1: one frame of the host to all boards, in the unit of the control mode.
SETPOINTS = tuple(
    _periodic(
        15, f"setpoints_{boards}", *(i16(f"setpoint_{board + 1}") for board in range(boards)), dialect=Dialect.BOTH
    )
    for boards in range(1, 5)
)
FOC_FEEDBACK = _periodic(
    0,
    "foc_feedback",
    i16("current", "A", 0.001),
    i16("velocity", "deg/s", 360 / 65.536),
    i32("position", "deg", 360 / 65536),
    dialect=_FOC,
    about="of the rotor; after each setpoint",
)
FOC_STATUS = _periodic(
    3,
    "foc_status",
    code("mode", BoardMode),
    flags("encoder", QuadratureState),
    i16("pwm", "%", 1 / 320),
    flags("faults", FocFault, "I"),
    dialect=_FOC,
    about="after each setpoint",
)
FOC_DEBUG = _periodic(9, "foc_debug", text("data", 8, 8), dialect=_FOC)
FOC_ADDITIONAL_STATUS = _periodic(12, "foc_additional_status", pad(2), i16("temperature"), dialect=_FOC)

MESSAGES = messages_of(vars())
