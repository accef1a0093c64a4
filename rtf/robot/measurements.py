"""All that the sensors of a device measure now, at once or one by one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from rtf.robot.errors import DeviceError
from rtf.robot.interfaces import IMultipleAnalogSensors, SensorCategory, SensorStatus

if TYPE_CHECKING:
    from rtf.robot.sensor_message import Measurements


class IMeasurementsSource(ABC):
    """Sensors that give all their readings at once, which is quicker than asking for each of them."""

    @abstractmethod
    def read_all(self) -> Measurements:
        """The readings of all categories, as many in each as ``sensors`` tells of. Nobody changes them.

        Raises DeviceError while a sensor is not well, as :func:`not_well` makes it.
        """


class DeviceMeasurements(IMeasurementsSource):
    """The same of a device by its interface: of the first so many categories, the sensors that it has now."""

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
    """What is raised for a sensor because of which nothing is told."""
    return DeviceError(f"the sensor {name} ({category.name}) is not well: {SensorStatus(status).name}")
