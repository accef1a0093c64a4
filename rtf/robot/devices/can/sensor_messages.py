"""The messages of sensor boards, and the management of all boards."""

from __future__ import annotations

from functools import partial

from rtf.robot.devices.can.codes import BoardType, InertialKind, StrainMode
from rtf.robot.devices.can.messages import (
    Field,
    Message,
    MessageClass,
    code,
    i16,
    messages_of,
    question,
    setting,
    text,
    u8,
    u16,
)

_command = partial(Message, MessageClass.SENSOR_POLLING)
_question = partial(question, MessageClass.SENSOR_POLLING)
_sensor = partial(Message, MessageClass.SENSOR_PERIODIC)
_inertial = partial(Message, MessageClass.INERTIAL_PERIODIC)
_manage = partial(Message, MessageClass.MANAGEMENT)


def _axes(make: partial[Field], *names: str) -> tuple[Field, ...]:
    return tuple(make(name) for name in names)


_vector = partial(_axes, partial(i16), "x", "y", "z")
_counts = partial(_axes, partial(u16), "x", "y", "z")

# Force-torque boards ---------------------------------------------------------------------------------------------

_SATURATION = "0x8000 is zero; saturation: bits 1 and 0 any, then two bits a channel, 1 low and 2 high"
FORCE = _sensor(10, "force", _counts(), about="0x8000 is zero, and as much again the full scale")
TORQUE = _sensor(11, "torque", _counts(), about=FORCE.about)
FORCE_SATURATED = _sensor(10, "force_saturated", (*_counts(), u8("saturation")), about=_SATURATION)
TORQUE_SATURATED = _sensor(11, "torque_saturated", (*_counts(), u8("saturation")), about=_SATURATION)
RAW_FORCE = _sensor(8, "raw_force", _counts())
RAW_TORQUE = _sensor(9, "raw_torque", _counts())
RAW_FORCE_SATURATED = _sensor(8, "raw_force_saturated", (*_counts(), u8("saturation")), about=_SATURATION)
RAW_TORQUE_SATURATED = _sensor(9, "raw_torque_saturated", (*_counts(), u8("saturation")), about=_SATURATION)
STRAIN_TEMPERATURE = _sensor(
    14, "strain_temperature", (u8("mask"), i16("temperature_0", "degC", 0.1), i16("temperature_1", "degC", 0.1))
)
SET_STRAIN_MODE = _command(7, "set_strain_mode", (code("mode", StrainMode),))
SET_SENSOR_RATE = _command(8, "set_sensor_rate", (u8("period", "s", 0.001),))
SET_TARE = _command(0x13, "set_tare", (text("data", 0, 7),))
SET_CURRENT_TARE = _command(0x15, "set_current_tare", (text("data", 0, 7),))
FULL_SCALE = _question(
    0x18, "full_scale", u8("channel"), u16("scale", big_endian=True), request=(u8("channel"),), about="in N, or in Nm"
)
SENSOR_VERSION = _question(
    0x1C,
    "sensor_version",
    code("board_type", BoardType),
    u8("firmware_major"),
    u8("firmware_minor"),
    u8("firmware_build"),
    u8("protocol_major"),
    u8("protocol_minor"),
    u8("acknowledged"),
    request=(u8("protocol_major"), u8("protocol_minor")),
)

# Hall sensors of a hand, inertial units, skin --------------------------------------------------------------------

MAIS_LOW = _sensor(12, "mais_low", tuple(u8(f"angle_{channel}") for channel in range(7)))
MAIS_HIGH = _sensor(13, "mais_high", tuple(u8(f"angle_{channel}") for channel in range(7, 15)))
GYROSCOPE = _inertial(0, "gyroscope", _vector(), about="the scale is a matter of configuration")
ACCELEROMETER = _inertial(1, "accelerometer", _vector(), about=GYROSCOPE.about)
INERTIAL_VECTOR = _inertial(3, "inertial_vector", (u8("sequence"), code("kind", InertialKind), *_vector()))
INERTIAL_QUATERNION = _inertial(4, "inertial_quaternion", (i16("w"), *_vector()))
INERTIAL_STATUS = _inertial(5, "inertial_status", (text("data", 0, 8),))
#: The triangles of a skin board, by number; each is sent as two messages.
SKIN = tuple(
    Message(
        MessageClass.SKIN_PERIODIC,
        triangle,
        f"skin_{triangle}",
        (u8("part"), *(u8(f"taxel_{taxel}") for taxel in range(7))),
        about="part: bit 7 is 0 for the taxels 0 to 6, and 1 for 7 to 11 and two bytes more",
    )
    for triangle in range(16)
)

# Management of all boards ----------------------------------------------------------------------------------------

DISCOVER = question(
    MessageClass.MANAGEMENT,
    0xFF,
    "board",
    code("board_type", BoardType),
    u8("firmware_major"),
    u8("firmware_minor"),
    u8("firmware_build"),
    about="joint boards stop their motors and broadcasts, too",
)
JUMP_TO_LOADER = _manage(0x00, "jump_to_loader")
PING = question(MessageClass.MANAGEMENT, 0x04, "pong", u8("alive"))
BOARD_INFORMATION = setting(
    MessageClass.MANAGEMENT,
    (0x0D, 0x0C),
    "board_information",
    u8("block"),
    text("text", 4, 4),
    about="eight blocks, and so many answers",
)
SET_ADDRESS = _manage(0x32, "set_address", (u8("address"),))

MESSAGES = messages_of(vars())
