"""The message of many sensors: its bytes, its bounds, and its other types of numbers."""

from __future__ import annotations

import struct
import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from replaying import VERSIONS, recordings, segments
from rtf.bottle import Bottle, BottleError, Dialect
from rtf.bottle.binary import TruncatedBottleError, encode
from rtf.errors import RtfError
from rtf.robot.interfaces import SensorReading
from rtf.robot.sensors.measurements import MAX_SENSORS, SENSOR_MESSAGE, Measurements

THREE, FOUR = Dialect.YARP3, Dialect.YARP4

values = st.lists(st.floats(width=64), max_size=7).map(np.array)
readings = st.builds(SensorReading, values.map(lambda array: array.astype(float)), st.floats(allow_nan=False))
measurements = st.lists(st.lists(readings, max_size=4), max_size=14)


def blocks(message: Measurements, dialect: Dialect = THREE) -> bytes:
    """Return all bytes of a message."""
    return b"".join(SENSOR_MESSAGE.encode(message, dialect))


def same(one: Measurements, other: Measurements) -> bool:
    """Return whether two messages are equal, NaN included."""
    flat = [[(reading.values.tobytes(), reading.time) for reading in category] for category in one]
    return flat == [[(reading.values.tobytes(), reading.time) for reading in category] for category in other]


def recorded(version: str) -> list[bytes]:
    """The bodies of the messages of a real IMU."""
    talk = segments(recordings(version, "sensors.json")["measures"])
    bodies = [data[data.index(b"~\0\0\1D ") :] for way, data in talk[2:] if way == ">"]
    return [body[body.index(b"\0", 6) + 1 :] for body in bodies]


@pytest.mark.parametrize("version", VERSIONS)
def test_messages_of_a_real_imu(version: str):
    """Recorded messages have four sensors in twelve categories; encoded again they have the same bytes."""
    bodies = recorded(version)
    assert len(bodies) > 5
    for body in bodies:
        message = SENSOR_MESSAGE.decode(body, VERSIONS[version])
        assert [len(category) for category in message] == [1, 1, 1, 1] + [0] * 8
        (gyroscope,), (accelerometer,), (magnetometer,), (orientation,) = message[:4]
        assert gyroscope.values.tolist() == magnetometer.values.tolist() == orientation.values.tolist()
        assert np.linalg.norm(accelerometer.values) == pytest.approx(9.81)
        assert gyroscope.time == pytest.approx(1795211050, abs=100)
        assert blocks(message, VERSIONS[version]) == body


def test_bytes_of_a_message():
    """A message is lists in lists: categories, sensors, a vector of doubles and a time."""
    message = [[], [SensorReading(np.array([1.5]), 2.5)]]
    expected = struct.pack("<ii ii ii ii ii d id", 256, 2, 256, 0, 256, 1, 256, 2, 266, 1, 1.5, 10, 2.5)
    assert blocks(message) == expected
    assert blocks(message, FOUR) == expected.replace(b"\x0a\x01", b"\x14\x01").replace(b"\x0a\0\0\0", b"\x14\0\0\0")


@pytest.mark.parametrize("values", [np.array([1, 2], dtype="f4"), np.arange(1.0, 4.0, 0.5)[:4:2], np.arange(3)[1:]])
def test_arrays_of_other_types_are_written_as_doubles(values: np.ndarray):
    """Arrays of any type and memory layout are encoded as doubles."""
    message = [[SensorReading(values, 2.5)], [], [SensorReading(np.zeros(0), 1.0)]]
    usual = [[SensorReading(np.array([1.0, 2.0]), 2.5)], [], [SensorReading(np.zeros(0), 1.0)]]
    assert blocks(message) == blocks(usual)


@given(measurements, st.sampled_from(Dialect))
def test_what_is_written_is_read(message: Measurements, dialect: Dialect):
    """Any message is the same after encoding and decoding, also if other data follow."""
    data = bytearray(blocks(message, dialect) + b"behind")
    read, end = SENSOR_MESSAGE.decode_from(data, dialect)
    assert end == len(data) - 6
    data[:] = bytes(len(data))
    assert same(read, message)


@given(measurements, st.data())
def test_a_message_that_is_cut_off(message: Measurements, data: st.DataObject):
    """A part of a message raises TruncatedBottleError."""
    whole = blocks(message)
    with pytest.raises(TruncatedBottleError) as caught:
        SENSOR_MESSAGE.decode_from(whole[: data.draw(st.integers(0, len(whole) - 1))], THREE)
    assert caught.value.needed <= len(whole)


@pytest.mark.fuzz
@given(st.binary(max_size=200), measurements, st.integers(0, 200), st.sampled_from(Dialect))
def test_any_bytes(noise: bytes, message: Measurements, place: int, dialect: Dialect):
    """Any bytes are a message, or raise RtfError."""
    whole = blocks(message)
    for data in (noise, whole[:place] + noise + whole[place + len(noise) :]):
        try:
            read = SENSOR_MESSAGE.decode(data, dialect)
        except RtfError:
            continue
        assert all(isinstance(reading, SensorReading) for category in read for reading in category)


@pytest.mark.parametrize("text", ["", "()", "(((1 2 3) 4))", "() (((1.5 2) 3.5) (() 4))", "((([pos] 1) 2))"])
def test_what_a_person_types(text: str):
    """Numbers of any type are read as doubles."""
    read = SENSOR_MESSAGE.from_text(text)
    assert all(reading.values.dtype == np.float64 for category in read for reading in category)
    assert SENSOR_MESSAGE.from_text(SENSOR_MESSAGE.to_text(read)) is not None
    assert same(SENSOR_MESSAGE.decode(encode(Bottle.parse(text), FOUR), FOUR), read)


@pytest.mark.parametrize("text", ["1", "hello", "(1)", "((1 2))", "(((1 a) 2))", "(((1) 2 3))", "(((1) a))", "((a 1))"])
def test_what_is_no_message(text: str):
    """Anything but lists of sensors raises BottleError."""
    with pytest.raises(BottleError):
        SENSOR_MESSAGE.from_text(text)


@pytest.mark.parametrize(
    "data",
    [
        struct.pack("<ii", 256, 2**31 - 1),
        struct.pack("<ii", 256, -1),
        struct.pack("<iiii", 256, 1, 256, 2**31 - 1),
        struct.pack("<8i", 256, 1, 256, 1, 256, 2, 266, 2**31 - 1),
        struct.pack("<8i", 256, 1, 256, 1, 256, 2, 266, -1),
        blocks([[SensorReading(np.zeros(1), 0.0)] * (MAX_SENSORS + 1)]),
        blocks([[]] * 65),
    ],
    ids=lambda data: data[:32].hex(" ", 4),
)
def test_sizes_are_bounded(data: bytes):
    """No memory is allocated for announced sensors or values that are missing or too many."""
    tracemalloc.start()
    with pytest.raises(BottleError):
        SENSOR_MESSAGE.decode(data, THREE)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 20_000_000
