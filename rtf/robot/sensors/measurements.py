"""The readings of all sensors of a device, all at once or one by one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from rtf.robot.errors import DeviceError
from rtf.robot.interfaces import IMultipleAnalogSensors, SensorCategory, SensorStatus

if TYPE_CHECKING:
    from rtf.robot.sensors.sensor_message import Measurements


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
