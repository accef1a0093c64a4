"""All measurements of a device, at once or one by one: servers publish the same."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING

import numpy as np
import pytest

from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.types import VECTOR
from rtf.robot.errors import DeviceError
from rtf.robot.interfaces import SensorCategory, SensorReading, SensorStatus
from rtf.robot.sensors.analog_sensors import AnalogSensorsServer
from rtf.robot.sensors.inertial import InertialServer
from rtf.robot.sensors.measurements import (
    SENSOR_MESSAGE,
    DeviceMeasurements,
    IMeasurementsSource,
    Measurements,
    not_well,
)

from ..sensor_bench import ScriptedSensors, connect

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network


class QuickSensors(ScriptedSensors, IMeasurementsSource):
    """Sensors that are also read all at once; ``asked`` counts these readings."""

    asked = 0

    def read_all(self) -> Measurements:
        """See IMeasurementsSource."""
        self.asked += 1
        if self.status != SensorStatus.OK:
            raise not_well("s0", SensorCategory.GYROSCOPE, self.status)
        return [*self.measurements, *([[]] * (len(SensorCategory) - len(self.measurements)))]


def readings(*values: float) -> list[SensorReading]:
    """A sensor for each value, of three axes."""
    return [SensorReading(np.array([value, value + 0.1, value + 0.2]), 1.0) for value in values]


def test_a_device_by_its_interface():
    """A device is read by its interface: all sensors in the requested number of categories."""
    measured = [readings(1.0), readings(2.0, 3.0), [], readings(4.0)]
    for categories in (12, 10):
        found = DeviceMeasurements(ScriptedSensors(measured), categories).read_all()
        assert found == [*measured, *([[]] * (categories - 4))]


def test_a_sensor_that_is_not_well_is_named():
    """The error names the sensor, and nothing is published."""
    sensors = ScriptedSensors([readings(1.0)])
    source = DeviceMeasurements(sensors)
    sensors.status = SensorStatus.OVERFLOW
    with pytest.raises(DeviceError, match=r"the sensor s0 \(GYROSCOPE\) has status OVERFLOW"):
        source.read_all()


@pytest.mark.parametrize("categories", [12, 10])
def test_a_source_is_asked_once_a_message(network: Network, said: list[str], categories: int):
    """A source is read once for a message, which has the requested number of categories."""
    sensors = QuickSensors([readings(1.0), readings(2.0)])
    with (
        closing(
            AnalogSensorsServer(sensors, "/imu", network=network, period=0.01, categories=categories, strict=True)
        ) as server,
        BufferedPort("/reader", SENSOR_MESSAGE, strict=True, network=network) as reader,
    ):
        connect(network, "/imu/measures:o", "/reader")
        server.publish(1.0)
        received = reader.read(10)
        sensors.status = SensorStatus.ERROR
        server.publish(2.0)
    assert sensors.asked == 2
    assert [[one.values.tolist() for one in category] for category in received] == [
        [[1.0, 1.1, 1.2]],
        [[2.0, 2.1, 2.2]],
        *([[]] * (categories - 2)),
    ]
    assert said == ["/imu: nothing is published: the sensor s0 (GYROSCOPE) has status ERROR"]


@pytest.mark.parametrize(("more", "asked"), [([], 1), ([readings(9.0)], 0)], ids=["alone", "with others"])
def test_twelve_numbers_of_a_source(network: Network, more: list[list[SensorReading]], asked: int):
    """A source with other sensors, too, is read one by one, so that their status does not matter."""
    sensors = QuickSensors([readings(1.0), readings(2.0), [], readings(7.0), *more])
    with (
        closing(InertialServer(sensors, "/inertial", network=network, period=0.01)) as server,
        BufferedPort("/reader", VECTOR, network=network) as reader,
    ):
        connect(network, "/inertial", "/reader")
        server.publish(3.0)
        values = reader.read(10)
    assert values.tolist() == [7.0, 7.1, 7.2, 2.0, 2.1, 2.2, 1.0, 1.1, 1.2, 0.0, 0.0, 0.0]
    assert sensors.asked == asked
