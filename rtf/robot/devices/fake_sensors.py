"""Sensors with generated values, a function of the time alone: for tests of everything that transports readings.

They do not model noise, drift or temperature, and their quantities are not consistent with one another.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rtf import clock
from rtf.robot import parameters
from rtf.robot.device import Device
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import (
    FloatArray,
    IAnalogSensor,
    IMultipleAnalogSensors,
    SensorCategory,
    SensorInfo,
    SensorReading,
    SensorStatus,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Property

GRAVITY = 9.81  # m/s²
_TURN = 360
_MAX_CHANNELS = 10_000


class FakeImu(Device, IMultipleAnalogSensors):
    """``fakeIMU``: a gyroscope, an accelerometer, a magnetometer and an orientation, one of each.

    A counter runs from 0 to 359 and starts over, one step each ``period`` (ms, default 10). All axes of three of the
    sensors have its value; the accelerometer measures gravity on a body that is pitched by as many degrees.
    ``constantValue`` keeps the counter at 0; ``sensorName`` and ``frameName`` are the names of the sensors.
    """

    def open(self, configuration: Property) -> None:
        self.period = parameters.positive(configuration, "period", 10.0) * 1e-3
        self._constant = parameters.flag(configuration, "constantValue")
        names = [[*parameters.names(configuration, key)] or [key] for key in ("sensorName", "frameName")]
        self._info = SensorInfo(names[0][0], names[1][0])
        self.state = SensorStatus.OK

    def close(self) -> None:
        """Do nothing: there are no resources."""

    def sensors(self, category: SensorCategory) -> Sequence[SensorInfo]:
        return (self._info,) if category <= SensorCategory.ORIENTATION else ()

    def sensor_status(self, category: SensorCategory, index: int) -> SensorStatus:
        """Return the value of ``state``."""
        self._check(category, index)
        return self.state

    def read_sensor(self, category: SensorCategory, index: int) -> SensorReading:
        self._check(category, index)
        if self.state is not SensorStatus.OK:
            raise RefusedError(f"{self.name} has status {self.state.name}")
        now = clock.current().now()
        counter = 0 if self._constant else int(now / self.period) % _TURN
        return SensorReading(_shown(category, counter), now)

    def _check(self, category: SensorCategory, index: int) -> None:
        if index != 0 or category > SensorCategory.ORIENTATION:
            raise RefusedError(f"{self.name} has no {category.name} {index}; it has one of each of its four sensors")


def _shown(category: SensorCategory, counter: int) -> FloatArray:
    if category is not SensorCategory.ACCELEROMETER:
        return np.full(3, float(counter))
    pitch = math.radians(counter)
    return np.array([GRAVITY * math.sin(pitch), 0.0, -GRAVITY * math.cos(pitch)])


class FakeAnalogSensor(Device, IAnalogSensor):
    """``fakeAnalogSensor``: ``channels`` channels (default 6).

    Channel c measures c plus the seconds of the minute, minus its offset.
    """

    def open(self, configuration: Property) -> None:
        self._offsets = np.zeros(parameters.count(configuration, "channels", 6, _MAX_CHANNELS))

    def close(self) -> None:
        """Do nothing: there are no resources."""

    def channels(self) -> int:
        return self._offsets.size

    def read(self) -> SensorReading:
        now = clock.current().now()
        return SensorReading(self._raw(now) - self._offsets, now)

    def _raw(self, now: float) -> FloatArray:
        return np.arange(self._offsets.size, dtype=float) + now % 60

    def calibrate(self, channel: int | None = None, value: float | None = None) -> None:
        offsets = self._raw(clock.current().now()) - (value or 0.0)
        if channel is None:
            self._offsets = offsets
        elif 0 <= channel < self._offsets.size:
            self._offsets[channel] = offsets[channel]
        else:
            raise RefusedError(f"{self.name} has {self._offsets.size} channels, counted from 0, and no {channel}")
