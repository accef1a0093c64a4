"""The readings of all sensors of a device: their source, and the message with which they are sent.

The message is a list per category, with a list per sensor: the vector of its values, and their time. Programs up to
YARP 3.10 have ten categories, later ones twelve; any number is accepted. Categories and sensors are identified by their
order only.
"""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod
from functools import lru_cache
from itertools import chain
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from rtf.bottle import Bottle, BottleError, BottleLimitError, Dialect, as_float
from rtf.bottle.binary import TAGS, decode_from
from rtf.bottle.tags import LIST, pair
from rtf.middleware.types.codecs import TextCodec
from rtf.middleware.types.vector import VECTOR, contiguous
from rtf.robot.errors import DeviceError
from rtf.robot.interfaces import IMultipleAnalogSensors, SensorCategory, SensorReading, SensorStatus

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.types.codecs import Buffer

#: The readings by category and sensor. They are not modified after their creation.
Measurements: TypeAlias = list[list[SensorReading]]

#: The largest number of sensors in a message; large robots have a few hundred, skin patches included.
MAX_SENSORS = 10_000
_MAX_CATEGORIES = 64
_PARTS = 2  # elements of a sensor's list
_DOUBLE = np.dtype("<f8")
_HEAD = struct.Struct("<4i")
_TIME = struct.Struct("<id")


class IMeasurementsSource(ABC):
    """A device that provides the readings of all its sensors at once, which is faster than one call for each."""

    @abstractmethod
    def read_all(self) -> Measurements:
        """Return the readings of all categories, as many in each as ``sensors`` lists. They are not modified later.

        Raises DeviceError while the status of a sensor is not OK, see :func:`not_well`.
        """


class DeviceMeasurements(IMeasurementsSource):
    """The readings of a device through its interface: the sensors that it has now, in the first ``categories``."""

    def __init__(self, device: IMultipleAnalogSensors, categories: int = len(SensorCategory)) -> None:
        self._device = device
        self._sensors = [
            (category, [*device.sensors(category)]) for category in SensorCategory if category < categories
        ]

    def read_all(self) -> Measurements:
        status, read, well = self._device.sensor_status, self._device.read_sensor, SensorStatus.OK
        found: Measurements = []
        for category, infos in self._sensors:
            readings = []
            for index, info in enumerate(infos):
                state = status(category, index)
                if state != well:
                    raise not_well(info.name, category, state)
                readings.append(read(category, index))
            found.append(readings)
        return found


def not_well(name: str, category: SensorCategory, status: SensorStatus) -> DeviceError:
    """Return the error for a sensor whose status is not OK."""
    return DeviceError(f"the sensor {name} ({category.name}) has status {SensorStatus(status).name}")


class SensorMessageCodec(TextCodec[Measurements]):
    """Codec of readings. A received message may also be a typed list, with numbers of any type."""

    promise = "yarp/sensors"

    def encode(self, value: Measurements, dialect: Dialect) -> Sequence[Buffer]:
        """Return one block. No helper functions: it is called a hundred times a second for every part of a robot.

        The sizes rarely change, so the bytes between the values are cached.
        """
        double, pack = TAGS[dialect].float64_code, _TIME.pack
        measured: list[bytes] = []
        sizes: list[int] = []
        for values, time in chain.from_iterable(value):
            made = values if values.dtype is _DOUBLE else contiguous(values, _DOUBLE)
            sizes.append(made.size)
            measured.append(made.tobytes() + pack(double, time))
        frame = _frame(double, tuple(map(len, value)), tuple(sizes))
        parts = [b""] * (2 * len(frame) - 1)
        parts[::2], parts[1::2] = frame, measured
        return (b"".join(parts),)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[Measurements, int]:
        try:
            return _read(data, TAGS[dialect].float64_code)
        except (struct.error, _UnusualError):  # truncated, invalid, or with other types of numbers
            bottle, end = decode_from(data, 0, dialect)
            return _of(bottle), end


class _UnusualError(Exception):
    """The message does not have the usual layout."""


@lru_cache(maxsize=256)
def _frame(double: int, counts: tuple[int, ...], sizes: tuple[int, ...]) -> tuple[bytes, ...]:
    """Return the bytes around the values and times, for these numbers of sensors and sizes of values.

    There is one piece before each sensor's values, and one at the end.
    """
    pieces, left = [pair.pack(LIST, len(counts))], iter(sizes)
    for count in counts:
        pieces[-1] += pair.pack(LIST, count)
        for _ in range(count):
            pieces[-1] += _HEAD.pack(LIST, _PARTS, LIST | double, next(left))
            pieces.append(b"")
    return tuple(pieces)


def _read(data: Buffer, double: int) -> tuple[Measurements, int]:
    """Decode a message with the usual layout."""
    code, categories = pair.unpack_from(data)
    if code != LIST or not 0 <= categories <= _MAX_CATEGORIES:
        raise _UnusualError
    at, total = pair.size, 0
    found: Measurements = []
    for _ in range(categories):
        code, count = pair.unpack_from(data, at)
        at += pair.size
        total += count
        if code != LIST or count < 0 or total > MAX_SENSORS:
            raise _UnusualError
        readings = []
        for _ in range(count):
            code, parts, numbers, size = _HEAD.unpack_from(data, at)
            if code != LIST or parts != _PARTS or numbers != LIST | double or size < 0:
                raise _UnusualError
            at += _HEAD.size
            code, time = _TIME.unpack_from(data, at + 8 * size)
            if code != double:
                raise _UnusualError
            values = np.frombuffer(data, _DOUBLE, size, at).copy() if size else np.empty(0)
            readings.append(SensorReading(values, time))
            at += 8 * size + _TIME.size
        found.append(readings)
    return found, at


def _of(bottle: Bottle) -> Measurements:
    """Convert any bottle to readings. Raises BottleError."""
    lists = [_list(category, "a category") for category in bottle]
    if len(lists) > _MAX_CATEGORIES or sum(map(len, lists)) > MAX_SENSORS:
        raise BottleLimitError(f"a message of {len(lists)} categories has too many sensors")
    return [[_reading(_list(sensor, "a sensor")) for sensor in category] for category in lists]


def _list(value: object, what: str) -> Bottle:
    if not isinstance(value, Bottle):
        raise BottleError(f"{what} is a list, not {str(value)[:40]!r}")
    return value


def _reading(sensor: Bottle) -> SensorReading:
    if len(sensor) != _PARTS or not isinstance(sensor[1], int | float):
        raise BottleError(f"a sensor is a list of values and a time, not {sensor.to_text()[:40]!r}")
    return SensorReading(VECTOR.from_bottle(_list(sensor[0], "what a sensor measures")), as_float(sensor[1]))


SENSOR_MESSAGE = SensorMessageCodec()
