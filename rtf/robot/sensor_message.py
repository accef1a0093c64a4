"""The message in which the measurements of many sensors travel: a list for each category, in it one for each sensor.

A sensor's list is the vector of what it measured and the time of it. Programs up to YARP 3.10 know ten categories,
later ones twelve; a reader takes as many as are there. Only the order says which category and which sensor it is.
"""

from __future__ import annotations

import struct
from functools import lru_cache
from itertools import chain
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from rtf.bottle import Bottle, BottleError, BottleLimitError, Dialect, as_float
from rtf.bottle.binary import TAGS, decode_from
from rtf.bottle.tags import LIST, pair
from rtf.middleware.codecs import TextCodec
from rtf.middleware.types.vector import VECTOR, contiguous
from rtf.robot.interfaces import SensorReading

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.carriers.base import Buffer

#: The readings by category, and in a category by sensor. Nobody changes them once they are made.
Measurements: TypeAlias = list[list[SensorReading]]

#: Sensors that one message may tell of; the largest robots have a few hundred, patches of skin included.
MAX_SENSORS = 10_000
_MAX_CATEGORIES = 64
_PARTS = 2  # of a sensor's list
_DOUBLE = np.dtype("<f8")
_HEAD = struct.Struct("<4i")
_TIME = struct.Struct("<id")


class SensorMessageCodec(TextCodec[Measurements]):
    """Measurements. What arrives may also be a list that somebody typed, with numbers of any type."""

    promise = "yarp/sensors"

    def encode(self, value: Measurements, dialect: Dialect) -> Sequence[Buffer]:
        """One block. Flat, for it is made a hundred times a second for every part of a robot.

        The sizes hardly ever change, and with them all that stands between the measurements.
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
        except (struct.error, _UnusualError):  # cut off, no such message, or one that says the same in other types
            bottle, end = decode_from(data, 0, dialect)
            return _of(bottle), end


class _UnusualError(Exception):
    """The bytes are not those that programs send."""


@lru_cache(maxsize=256)
def _frame(double: int, counts: tuple[int, ...], sizes: tuple[int, ...]) -> tuple[bytes, ...]:
    """What stands around the values and times in a message of categories with so many sensors, of such sizes.

    It is one piece in front of each sensor's, and one at the end.
    """
    pieces, left = [pair.pack(LIST, len(counts))], iter(sizes)
    for count in counts:
        pieces[-1] += pair.pack(LIST, count)
        for _ in range(count):
            pieces[-1] += _HEAD.pack(LIST, _PARTS, LIST | double, next(left))
            pieces.append(b"")
    return tuple(pieces)


def _read(data: Buffer, double: int) -> tuple[Measurements, int]:
    """What is in the bytes if they are just as they are usually written."""
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
    """The same of any bottle. Raises BottleError."""
    lists = [_list(category, "a category") for category in bottle]
    if len(lists) > _MAX_CATEGORIES or sum(map(len, lists)) > MAX_SENSORS:
        raise BottleLimitError(f"a message of {len(lists)} categories tells of too many sensors")
    return [[_reading(_list(sensor, "a sensor")) for sensor in category] for category in lists]


def _list(value: object, what: str) -> Bottle:
    if not isinstance(value, Bottle):
        raise BottleError(f"{what} is a list, {str(value)[:40]!r} is none")
    return value


def _reading(sensor: Bottle) -> SensorReading:
    if len(sensor) != _PARTS or not isinstance(sensor[1], int | float):
        raise BottleError(f"a sensor is a list of values and a time, {sensor.to_text()[:40]!r} came")
    return SensorReading(VECTOR.from_bottle(_list(sensor[0], "what a sensor measures")), as_float(sensor[1]))


SENSOR_MESSAGE = SensorMessageCodec()
