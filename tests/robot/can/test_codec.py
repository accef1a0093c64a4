"""Frames of the CAN buses: their bytes, the round trip of every message, and frames that are none."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot.devices.can import motor_messages as motor
from rtf.robot.devices.can import sensor_messages as sensor
from rtf.robot.devices.can.codec import MESSAGES, decode, dialect_of
from rtf.robot.devices.can.codes import BoardMode, BoardType, FocFault
from rtf.robot.devices.can.messages import EVERYONE, HOST, Dialect, Field, Frame, Message
from rtf.robot.errors import MessageError

DIALECTS = [Dialect.JOINT, Dialect.FOC]
DATA = st.binary(max_size=8)


def values_of(one: Field) -> st.SearchStrategy[float | bytes]:
    """Return the values that a field can have."""
    if one.range is not None:
        return st.integers(*one.range)
    if one.layout == "s":
        return st.binary(min_size=one.least_size, max_size=one.size)
    return st.floats(width=32 if one.layout == "f" else 16)


@st.composite
def sent(draw: st.DrawFn) -> tuple[Message, int, int, tuple[float | bytes, ...]]:
    """A message with a board, an axis and values."""
    message = draw(st.sampled_from(MESSAGES))
    board = HOST if message in motor.SETPOINTS else draw(st.integers(1, 14))
    axis = draw(st.integers(0, 1)) if message.kind in (0, 2) else 0
    return message, board, axis, tuple(draw(values_of(one)) for one in message.fields)


@given(sent())
def test_what_is_encoded_is_decoded(sent_frame: tuple[Message, int, int, tuple[float | bytes, ...]]):
    """A frame has the message, the board, the axis and the values from which it was made, in each of its dialects."""
    message, board, axis, values = sent_frame
    frame = message.frame(board, *values, axis=axis)
    assert len(frame.data) <= 8
    for dialect in DIALECTS:
        if dialect & message.dialect:
            got = decode(*frame, dialect)
            assert (got.message, got.board, got.axis) == (message, board, axis)
            assert all(a == b or (a != a and b != b) for a, b in zip(values, got.values, strict=True))  # noqa: PLR0124


@given(st.integers(-5, 0x900), DATA | st.binary(max_size=12), st.sampled_from(DIALECTS))
def test_any_frame_is_decoded_or_refused(identifier: int, data: bytes, dialect: Dialect):
    """Any identifier and bytes are a message, which has the same bytes again, or raise MessageError."""
    try:
        got = decode(identifier, data, dialect)
    except MessageError:
        return
    assert 0 <= identifier <= 0x7FF
    if all(one.layout not in "xfe" for one in got.message.layout):  # padding is lost, and some NaN become others
        assert got.message.frame(1, *got.values, axis=got.axis).data == data


@pytest.mark.parametrize(
    ("frame", "expected"),
    [
        (motor.POSITION_MOVE.frame(3, 65536, -2, axis=1), (0x003, "9B 00 00 01 00 FE FF")),
        (motor.ENCODER.value.frame(3, -1, 256), (0x030, "14 FF FF FF FF 00 01")),
        (motor.BROADCAST_POSITION.frame(5, 1, 2), (0x151, "01 00 00 00 02 00 00 00")),
        (motor.SETPOINTS[3].frame(HOST, 1, 2, 3, 4), (0x10F, "01 00 02 00 03 00 04 00")),
        (motor.FOC_FEEDBACK.frame(2, -1, 2, 3), (0x120, "FF FF 02 00 03 00 00 00")),
        (motor.VERSION.get.frame(1, 1, 6), (0x001, "5B 01 06")),
        (sensor.DISCOVER.get.frame(EVERYONE), (0x70F, "FF")),
        (sensor.DISCOVER.value.frame(4, BoardType.FOC_2, 1, 2, 3), (0x740, "FF 08 01 02 03")),
        (sensor.FULL_SCALE.value.frame(13, 2, 500), (0x2D0, "18 02 01 F4")),
        (sensor.FORCE.frame(13, 0x8000, 0, 0xFFFF), (0x3DA, "00 80 00 00 FF FF")),
        (sensor.SKIN[7].frame(8, 0x40, 1, 2, 3, 4, 5, 6, 7), (0x487, "40 01 02 03 04 05 06 07")),
    ],
)
def test_bytes(frame: Frame, expected: tuple[int, str]):
    """Messages have the identifiers and bytes of the protocol."""
    assert (frame.identifier, frame.data.hex(" ").upper()) == expected


def test_the_bit_of_the_axis_is_of_motors_only():
    """A command of the management may be above 127: its highest bit is no axis."""
    assert decode(0x70F, b"\xff").message is sensor.DISCOVER.get
    assert decode(0x003, b"\x94").axis == 1


def test_dialects_give_types_different_meanings():
    """Type 3 is the status of two joints or of one motor, as the board's type says."""
    frame = motor.FOC_STATUS.frame(1, BoardMode.CURRENT, 0, 3200, FocFault.SETPOINT_EXPIRED)
    assert decode(*frame, dialect_of(BoardType.FOC_2)).message is motor.FOC_STATUS
    assert decode(*frame, dialect_of(BoardType.MC_4DC)).message is motor.STATUS
    assert decode(*frame, Dialect.FOC).scaled() == {"mode": 6, "encoder": 0, "pwm": 10.0, "faults": 1 << 9}


@pytest.mark.parametrize(
    ("identifier", "data", "said"),
    [
        (0x003, b"", "no data"),
        (0x003, b"\x7e", "no command 126 in the class 0"),
        (0x003, b"\x1b\0\0", "position_move has 7 bytes of data, not 3"),
        (0x15E, bytes(8), "no type 14 in the class 1"),
        (0x601, b"\1", "no type 1 in the class 6"),
        (0x800, b"\1", "more than 11 bits"),
        (0x151, bytes(9), "more than 8 bytes"),
    ],
)
def test_frames_that_are_no_messages_are_named(identifier: int, data: bytes, said: str):
    """The error shows the frame, and says what is wrong."""
    with pytest.raises(MessageError, match=said):
        decode(identifier, data)


@pytest.mark.parametrize("position", [-(1 << 31) - 1, 1 << 31, 0.5, math.inf, "1"])
def test_values_that_do_not_fit_are_reported(position: object):
    """An integer is never wrapped, and a fraction never cut off: the error names the field and its range."""
    with pytest.raises(MessageError, match="target is an integer from -2147483648 to 2147483647"):
        motor.POSITION_MOVE.frame(3, position, 10)


def test_other_mistakes_are_reported():
    """Wrong numbers of values, addresses, axes and lengths of texts raise MessageError."""
    for make, said in [
        (lambda: motor.POSITION_MOVE.frame(3, 1), "has 2 values"),
        (lambda: motor.POSITION_MOVE.frame(16, 1, 2), "no board 16"),
        (lambda: motor.POSITION_MOVE.frame(3, 1, 2, axis=2), "axis 2"),
        (lambda: motor.INFORMATION.set.frame(3, 0, b"abc"), "4 to 4 bytes"),
        (lambda: motor.MOTOR_PARAMETER.set.frame(3, 1, 1e300), "do not fit"),
    ]:
        with pytest.raises(MessageError, match=said):
            make()


def test_lengths_fit_into_frames():
    """No message is longer than a frame, and none has the same name as another."""
    assert max(size for message in MESSAGES for size in message.structs) == 8
    assert len({message.name for message in MESSAGES}) == len(MESSAGES)


def test_numbers_are_little_endian():
    """Only the full scale of a strain board is big-endian."""
    odd = [message.name for message in MESSAGES if any(one.big_endian for one in message.layout)]
    assert odd == ["full_scale"]
    assert motor.MIN_POSITION.set.frame(1, 258).data[1:] == struct.pack("<i", 258)
