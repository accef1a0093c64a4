"""The extended state: its bytes in both dialects, and the refusal of other bytes."""

from __future__ import annotations

import struct
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from replaying import recordings
from rtf.bottle import BottleError, Dialect
from rtf.bottle.binary import TruncatedBottleError, decode
from rtf.bottle.values import to_single
from rtf.robot.errors import RefusedError, StaleStateError
from rtf.robot.extended_state import (
    EXTENDED_STATE,
    ExtendedState,
    Field,
    InterfaceState,
    mean_time,
)
from rtf.robot.interfaces import FloatArray, IEncoders

DIALECTS = pytest.mark.parametrize("dialect", Dialect, ids=lambda dialect: dialect.name)
OK, FAIL = bytes.fromhex("090000006f6b0000"), bytes.fromhex("090000006661696c")


@st.composite
def states(draw: st.DrawFn) -> ExtendedState:
    """Generate states of up to twenty axes, with any numbers, NaN and infinity, too."""
    state = ExtendedState(draw(st.integers(0, 20)))
    state.floats[:] = draw(arrays.arrays(np.float64, state.floats.shape))
    state.modes[:] = draw(arrays.arrays(np.int32, state.modes.shape))
    state.temperatures[:] = draw(arrays.arrays(np.float32, state.axes))
    state.valid[:] = draw(arrays.arrays(np.bool_, state.valid.shape))
    return state


def one_by_one(state: ExtendedState, dialect: Dialect) -> bytes:
    """Return the message, encoded number by number."""
    four = dialect is Dialect.YARP4
    double, single = (256 + 20, 256 + 10) if four else (256 + 10, 256 + 128)
    message = struct.pack("<ii", 256, 24 if four else 22)
    for field in Field:
        if field is Field.TEMPERATURES and not four:
            continue
        values = state.values(field).tolist()
        if field in (Field.CONTROL_MODES, Field.INTERACTION_MODES):
            code, letter = 256 + 1, "i"
        elif field is Field.TEMPERATURES or (four and field is Field.DUTY_CYCLES):
            code, letter = single, "f"
            values = [to_single(value) for value in values]
        else:
            code, letter = double, "d"
        message += struct.pack(f"<ii{len(values)}{letter}", code, len(values), *values)
        message += OK if state.valid[field] else FAIL
    return message


def test_first_bytes_for_two_joints():
    """The heads, numbers and words of a message have the places that YARP 3 gives them."""
    state = ExtendedState(2)
    state.joint_positions[:] = 1.0, 2.0
    state.valid[Field.JOINT_POSITIONS] = True
    data = state.write(Dialect.YARP3)
    assert len(data) == 344
    assert data[:16].hex(" ") == "00 01 00 00 16 00 00 00 0a 01 00 00 02 00 00 00"
    assert data[16:32] == struct.pack("<2d", 1.0, 2.0)
    assert data[32:48].hex(" ") == "09 00 00 00 6f 6b 00 00 0a 01 00 00 02 00 00 00"


@given(state=states())
def test_bytes_are_those_of_each_number(state: ExtendedState):
    """The encoder's template gives the bytes of encoding number by number, in either dialect."""
    with np.errstate(all="ignore"):
        for dialect in Dialect:
            assert state.write(dialect) == one_by_one(state, dialect)


@given(state=states())
def test_what_is_written_is_read(state: ExtendedState):
    """A state is the same after encoding and decoding, whichever dialect the reader expects."""
    for dialect, expected in product(Dialect, Dialect):
        data = state.write(dialect)
        read, end = EXTENDED_STATE.decode_from(data + b"more", expected)
        assert end == len(data)
        exact = [field for field in Field if field not in (Field.DUTY_CYCLES, Field.TEMPERATURES)]
        for field in exact:
            assert np.array_equal(read.values(field), state.values(field), equal_nan=field < Field.CONTROL_MODES)
            assert read.valid[field] == state.valid[field]
        assert read.write(dialect) == data


@given(state=states())
def test_a_bottle_reads_it_too(state: ExtendedState):
    """The message is a bottle, of 22 elements in YARP 3 and 24 in YARP 4."""
    assert len(decode(state.write(Dialect.YARP3))) == 22
    assert len(decode(state.write(Dialect.YARP4), Dialect.YARP4)) == 24


def test_one_state_takes_many_messages():
    """Each decoded message replaces all values of the state, also after one of the other dialect."""
    taken, sent = ExtendedState(3), ExtendedState(3)
    for number in range(4):
        sent.floats.fill(number)
        sent.valid[:] = number % 2
        assert taken.take(sent.write(Dialect.YARP3)) == len(sent.write(Dialect.YARP3))
        taken.take(sent.write(Dialect.YARP4))
        assert (taken.floats == number).all()
        assert taken.valid.all() == bool(number % 2)


def test_state_of_another_board_is_refused():
    """A state refuses a message of another number of axes, and stays unchanged."""
    taken = ExtendedState(3)
    with pytest.raises(BottleError, match="2 axes arrived, but 3"):
        taken.take(ExtendedState(2).write(Dialect.YARP3))
    assert not taken.valid.any()


@DIALECTS
@given(data=st.data())
def test_a_truncated_message(dialect: Dialect, data: st.DataObject):
    """A truncated message raises an error with the number of needed bytes, at most those of the message."""
    whole = ExtendedState(data.draw(st.integers(0, 5))).write(dialect)
    size = data.draw(st.integers(0, len(whole) - 1))
    with pytest.raises(TruncatedBottleError) as caught:
        EXTENDED_STATE.decode_from(whole[:size], dialect)
    assert size < caught.value.needed <= len(whole)


@DIALECTS
@settings(max_examples=120)
@given(state=states(), data=st.data())
def test_damaged_bytes_are_an_error_or_a_state(dialect: Dialect, state: ExtendedState, data: st.DataObject):
    """A damaged message raises BottleError, or gives the state that its bytes encode."""
    damaged = bytearray(state.write(dialect))
    for place in data.draw(st.lists(st.integers(0, len(damaged) - 1), min_size=1, max_size=4)):
        damaged[place] = data.draw(st.integers(0, 255))
    try:
        read, end = EXTENDED_STATE.decode_from(bytes(damaged), dialect)
    except BottleError:
        return
    assert end == len(damaged)
    assert read.joint_positions.tobytes() == damaged[16 : 16 + 8 * read.axes]
    assert len(read.write(dialect)) == end


@given(data=st.binary(max_size=200))
def test_any_bytes_are_an_error(data: bytes):
    """Bytes that are no state raise BottleError."""
    with pytest.raises(BottleError):
        EXTENDED_STATE.decode_from(data, Dialect.YARP3)


@pytest.mark.parametrize("axes", [-1, 10**6, 2**31 - 1])
def test_a_number_of_axes_is_not_believed(axes: int):
    """A message that announces too many axes is refused before memory is allocated."""
    data = struct.pack("<iiii", 256, 22, 266, axes) + bytes(64)
    with pytest.raises(BottleError, match=f"{axes} numbers"):
        EXTENDED_STATE.decode_from(data, Dialect.YARP3)


def test_text_form():
    """A state can be written as text, and read from it."""
    state = ExtendedState(1)
    state.joint_positions[:] = 1.5
    state.valid[:] = True
    text = EXTENDED_STATE.to_text(state)
    assert text.startswith("(1.5) [ok] (0.0) [ok] ")
    assert EXTENDED_STATE.from_text(text).joint_positions.tolist() == [1.5]


def test_copies_are_apart():
    """A change of a state does not change its copy."""
    state = ExtendedState(2)
    state.valid.fill(True)
    copied = state.copy()
    state.floats.fill(3.0)
    state.modes.fill(4)
    assert not copied.floats.any()
    assert not copied.modes.any()
    assert copied.valid.all()


def test_recorded_states_are_read_and_written():
    """The recorded states of a real board are decoded, and encoded to the same bytes."""
    for _, data in recordings("3.12.3", "board_clients.json")["state"]:
        message = bytes.fromhex(data)
        state, end = EXTENDED_STATE.decode_from(message, Dialect.YARP3)
        assert end == len(message)
        assert state.axes == 6
        assert state.valid[: Field.TEMPERATURES].all()
        assert state.duty_cycles.tolist() == [33.0, 34.0, 35.0, 36.0, 37.0, 38.0]
        assert state.write(Dialect.YARP3) == message


class Encoders(IEncoders):
    """Encoders of two joints with these times; speeds are refused, and accelerations have a wrong size."""

    def __init__(self, *times: float) -> None:
        self.times = np.array(times)

    def encoders(self, joints=None) -> FloatArray:
        """See IEncoders."""
        return np.array([1.0, 2.0])

    def encoder_speeds(self, joints=None) -> FloatArray:
        """See IEncoders."""
        raise RefusedError("not now")

    def encoder_accelerations(self, joints=None) -> FloatArray:
        """See IEncoders."""
        return np.zeros(3)

    def encoder_times(self, joints=None) -> FloatArray:
        """See IEncoders."""
        return self.times

    def set_encoders(self, values, joints=None) -> None:
        """See IEncoders."""

    def reset_encoders(self, joints=None) -> None:
        """See IEncoders."""


def test_what_a_device_has_not_got_is_not_valid():
    """Fields of missing interfaces, refused ones and those of a wrong size are 0 and not valid."""
    state = ExtendedState(2)
    state.floats.fill(9.0)
    assert InterfaceState(Encoders(10.0, 10.5)).fill_state(state) == 10.25
    assert state.joint_positions.tolist() == [1.0, 2.0]
    assert [field for field in Field if state.valid[field]] == [Field.JOINT_POSITIONS]
    assert state.joint_velocities.tolist() == [0.0, 0.0]


def test_a_device_without_encoders_has_no_time():
    """The time of a state without encoders is NaN."""
    assert np.isnan(InterfaceState(object()).fill_state(ExtendedState(2)))


def test_times_that_are_apart_are_an_error():
    """Times of joints more than a second apart raise an error that names both joints."""
    assert mean_time(np.array([1.0, 2.0])) == 1.5
    with pytest.raises(StaleStateError, match="joints 1 and 0"):
        mean_time(np.array([2.5, 1.0]))
