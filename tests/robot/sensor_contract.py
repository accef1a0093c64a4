"""The contract of devices with sensors, local or through the network."""

from __future__ import annotations

import numpy as np
import pytest

from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import IMultipleAnalogSensors, SensorCategory, SensorInfo, SensorStatus
from waiting import eventually

#: The number of values of a sensor, by category; sensors of other categories have one value for each element.
VALUES = dict.fromkeys(SensorCategory, 3) | {SensorCategory.TEMPERATURE: 1, SensorCategory.FORCE_TORQUE: 6}
ARRAYS = (SensorCategory.CONTACT_LOAD_CELLS, SensorCategory.ENCODER_ARRAY, SensorCategory.SKIN_PATCH)


def every_sensor(device: IMultipleAnalogSensors) -> list[tuple[SensorCategory, int]]:
    """Return category and index of every sensor."""
    return [(category, index) for category in SensorCategory for index in range(len(device.sensors(category)))]


def is_well(device: IMultipleAnalogSensors) -> bool:
    """Return whether the status of all sensors is OK."""
    return all(device.sensor_status(*place) is SensorStatus.OK for place in every_sensor(device))


class MultipleAnalogSensorsContract:
    """To be subclassed with a fixture ``sensors``: a device whose sensors are well, and measure what changes."""

    def test_every_category_can_be_asked(self, sensors: IMultipleAnalogSensors):
        """Every category can be asked for; its sensors have descriptions."""
        found = [info for category in SensorCategory for info in sensors.sensors(category)]
        assert found
        assert all(isinstance(info, SensorInfo) and all(isinstance(text, str) for text in info) for info in found)

    def test_every_sensor_is_read_in_its_shape(self, sensors: IMultipleAnalogSensors):
        """A reading is an array of doubles of the size of its category, and a time."""
        for category, index in every_sensor(sensors):
            values, time = sensors.read_sensor(category, index)
            assert values.dtype == np.float64
            assert values.ndim == 1
            assert category in ARRAYS or values.size == VALUES[category]
            assert np.isfinite(values).all()
            assert time > 0

    def test_they_are_well(self, sensors: IMultipleAnalogSensors):
        """Each sensor's status is OK."""
        assert is_well(sensors)

    def test_other_sensors_are_refused(self, sensors: IMultipleAnalogSensors):
        """An index below 0 or beyond the last is refused, also in a category without sensors."""
        for category in SensorCategory:
            for index in (-1, len(sensors.sensors(category))):
                with pytest.raises(RefusedError):
                    sensors.read_sensor(category, index)
                with pytest.raises(RefusedError):
                    sensors.sensor_status(category, index)

    def test_measurements_go_on(self, sensors: IMultipleAnalogSensors):
        """Later readings have later times and other values; earlier ones do not change."""
        place = every_sensor(sensors)[0]
        first = sensors.read_sensor(*place)
        kept = first.values.copy()
        eventually(lambda: sensors.read_sensor(*place).time > first.time, "the time stands still")
        eventually(lambda: not np.array_equal(sensors.read_sensor(*place).values, kept), "the values stand still")
        assert (first.values == kept).all()
