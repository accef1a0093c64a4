"""A remapper of sensors: sensors of several devices as one device."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot import parameters
from rtf.robot.device import Device
from rtf.robot.errors import DeviceError, RefusedError
from rtf.robot.interfaces import IMultipleAnalogSensors, SensorCategory, SensorInfo, SensorReading, SensorStatus

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rtf.bottle import Property

#: The name of a category in configurations.
CATEGORY_TAGS: Mapping[SensorCategory, str] = {
    SensorCategory.GYROSCOPE: "ThreeAxisGyroscopes",
    SensorCategory.ACCELEROMETER: "ThreeAxisLinearAccelerometers",
    SensorCategory.MAGNETOMETER: "ThreeAxisMagnetometers",
    SensorCategory.ORIENTATION: "OrientationSensors",
    SensorCategory.TEMPERATURE: "TemperatureSensors",
    SensorCategory.FORCE_TORQUE: "SixAxisForceTorqueSensors",
    SensorCategory.CONTACT_LOAD_CELLS: "ContactLoadCellArrays",
    SensorCategory.ENCODER_ARRAY: "EncoderArrays",
    SensorCategory.SKIN_PATCH: "SkinPatches",
    SensorCategory.POSITION: "PositionSensors",
    SensorCategory.LINEAR_VELOCITY: "LinearVelocitySensors",
    SensorCategory.ANGULAR_ACCELEROMETER: "ThreeAxisAngularAccelerometers",
}


class AnalogSensorsRemapper(Device, IMultipleAnalogSensors):
    """``multipleanalogsensorsremapper``: sensors selected by name, in the given order.

    Parameters are lists of names, one for each category: ``SixAxisForceTorqueSensorsNames (l_leg_ft r_leg_ft)``.
    ``attach`` passes the devices that have them; each name must be that of exactly one sensor.
    """

    def open(self, configuration: Property) -> None:
        self._wanted = {
            category: parameters.names(configuration, f"{tag}Names") for category, tag in CATEGORY_TAGS.items()
        }
        self._sensors: dict[SensorCategory, list[tuple[IMultipleAnalogSensors, int]]] = {}

    def attach(self, devices: Mapping[str, Device]) -> None:
        """Attach the devices. Raises DeviceError for a name that no device has, or several."""
        found = {name: device for name, device in devices.items() if isinstance(device, IMultipleAnalogSensors)}
        self._sensors = {
            category: [self._find(category, name, found) for name in names] for category, names in self._wanted.items()
        }

    def _find(
        self, category: SensorCategory, name: str, devices: Mapping[str, IMultipleAnalogSensors]
    ) -> tuple[IMultipleAnalogSensors, int]:
        places = [
            (owner, device, index)
            for owner, device in devices.items()
            for index, info in enumerate(device.sensors(category))
            if info.name == name
        ]
        if len(places) != 1:
            owners = ", ".join(owner for owner, _, _ in places) or f"none of {', '.join(devices) or 'no devices'}"
            raise DeviceError(
                f"{self.name}: exactly one device must have the sensor {name} ({category.name}): {owners} has it"
            )
        return places[0][1:]

    def detach(self) -> None:
        self._sensors = {}

    def close(self) -> None:
        self.detach()

    def sensors(self, category: SensorCategory) -> Sequence[SensorInfo]:
        """Return the sensors of a category; none while no devices are attached."""
        return [device.sensors(category)[index] for device, index in self._sensors.get(category, ())]

    def sensor_status(self, category: SensorCategory, index: int) -> SensorStatus:
        device, inner = self._sensor(category, index)
        return device.sensor_status(category, inner)

    def read_sensor(self, category: SensorCategory, index: int) -> SensorReading:
        device, inner = self._sensor(category, index)
        return device.read_sensor(category, inner)

    def _sensor(self, category: SensorCategory, index: int) -> tuple[IMultipleAnalogSensors, int]:
        found = self._sensors.get(category, [])
        if not 0 <= index < len(found):
            raise RefusedError(f"{self.name} has {len(found)} sensors {category.name}, counted from 0, and no {index}")
        return found[index]
