"""Decoding sensor messages: one row of numbers for each message, and the names of the channels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.errors import RtfError
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.types import VECTOR, call
from rtf.robot.interfaces import SensorCategory
from rtf.robot.sensors.analog_sensors import read_metadata
from rtf.robot.sensors.measurements import SENSOR_MESSAGE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.ports.network import Network
    from rtf.robot.interfaces import FloatArray, SensorInfo, SensorReading
    from rtf.robot.sensors.measurements import Measurements
    from rtf.robot_testing.streams.message import Message

#: The suffix of the stream of a server with several sensors.
MEASURES = "/measures:o"
_RPC_TIMEOUT = 3.0


def readings_of(port: str, messages: Sequence[Message]) -> FloatArray:
    """Return the measurements of messages, whose bytes were kept, as rows.

    Raises ValueError if the messages have different numbers of values, or cannot be decoded.
    """
    if port.endswith(MEASURES):
        rows = [_flat(SENSOR_MESSAGE.decode(one.data, one.dialect)) for one in messages]
    else:
        rows = [VECTOR.decode(one.data, one.dialect) for one in messages]
    if len({row.size for row in rows}) > 1:
        raise ValueError(f"{port}: the number of values differs between messages: {sorted({row.size for row in rows})}")
    return np.array(rows, dtype=np.float64)


def sensors_in(port: str, messages: Sequence[Message], category: SensorCategory) -> list[FloatArray]:
    """Return the measurements of each sensor of a category, as rows; errors as for ``readings_of``.

    For messages of several sensors. A device may have sensors of several categories in one message, such as the
    gyroscope and the thermometer of a force sensor.
    """
    rows = [[one.values for one in _of_category(message, category)] for message in messages]
    kinds = {tuple(values.size for values in row) for row in rows}
    if len(kinds) > 1:
        raise ValueError(f"{port}: the number of {category.name} values differs between messages: {sorted(kinds)}")
    return [np.array(values, dtype=np.float64) for values in zip(*rows, strict=True)]


def _of_category(message: Message, category: SensorCategory) -> list[SensorReading]:
    found = SENSOR_MESSAGE.decode(message.data, message.dialect)
    return found[category] if category < len(found) else []


def _flat(measurements: Measurements) -> FloatArray:
    values = [reading.values for readings in measurements for reading in readings]
    return np.concatenate(values) if values else np.empty(0)


def sensors_of(network: Network, port: str) -> list[list[SensorInfo]]:
    """Return the metadata of the sensors of a server, by category; ``port`` is its stream. Raises RtfError."""
    server = f"{port.removesuffix(MEASURES)}/rpc:o"
    with RpcClient("", server, network=network) as client:
        answer = client.call(call("getMetadata"), timeout=_RPC_TIMEOUT)
    return read_metadata(answer, server) if answer is not None else []


def names_of(network: Network, port: str, category: SensorCategory) -> list[str]:
    """Return the names of the sensors of a category; none if their server does not answer."""
    try:
        infos = sensors_of(network, port)
    except RtfError:
        return []
    return [info.name for info in infos[category]] if category < len(infos) else []


def channels_of(network: Network, port: str, count: int) -> list[str]:
    """Return readable names of the ``count`` numbers of a row."""
    numbered = [f"channel {channel}" for channel in range(count)]
    if not port.endswith(MEASURES):
        return numbered
    try:
        infos = sensors_of(network, port)
    except RtfError:
        return numbered  # good enough: no verdict depends on names
    named = [
        f"{info.name} {SensorCategory(category).name.lower()} {axis}"
        for category, sensors in enumerate(infos)
        for info in sensors
        for axis in range(_SIZES.get(category, 3))
    ]
    return named if len(named) == count else numbered


_SIZES: dict[int, int] = {SensorCategory.FORCE_TORQUE: 6, SensorCategory.TEMPERATURE: 1}
