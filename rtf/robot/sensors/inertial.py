"""Inertial sensors of the oldest kind: twelve numbers, without an RPC port."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.middleware.types import VECTOR
from rtf.robot import parameters
from rtf.robot.errors import DeviceError, NoAnswerError, RefusedError
from rtf.robot.interfaces import (
    FloatArray,
    IMultipleAnalogSensors,
    SensorCategory,
    SensorInfo,
    SensorReading,
    SensorStatus,
)
from rtf.robot.network.publishing_device import PublishingDevice
from rtf.robot.network.stream_client import StreamClient
from rtf.robot.network.stream_server import StreamServer
from rtf.robot.sensors.measurements import IMeasurementsSource

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Property
    from rtf.middleware.ports.network import Network
    from rtf.robot.device import Device
    from rtf.robot.publishing import Outlets

#: The sensors in the order of the message, three numbers each.
ORDER = (
    SensorCategory.ORIENTATION,
    SensorCategory.ACCELEROMETER,
    SensorCategory.GYROSCOPE,
    SensorCategory.MAGNETOMETER,
)
AXES = 3
_NUMBERS = AXES * len(ORDER)


# The server -----------------------------------------------------------------------------------------------------------


class InertialServer(StreamServer[FloatArray]):
    """Publishes the first orientation, accelerometer, gyroscope and magnetometer of a device at ``NAME``.

    The values of a missing sensor are zeros. A device that is an IMeasurementsSource and has no other sensors is read
    with one call. Raises ConnectError and AddressError.
    """

    def __init__(
        self,
        device: IMultipleAnalogSensors,
        name: str,
        *,
        network: Network,
        period: float,
        strict: bool = False,
        outlets: Outlets | None = None,
    ) -> None:
        super().__init__(name, network=network, period=period, strict=strict, outlets=outlets)
        self._device = device
        self._places = [
            (slice(place * AXES, (place + 1) * AXES), one) for place, one in enumerate(ORDER) if device.sensors(one)
        ]
        alone = sum(len(device.sensors(one)) for one in SensorCategory) == len(self._places)
        self._source = device if alone and isinstance(device, IMeasurementsSource) else None
        self.open_ports([name], VECTOR)

    def measure(self, now: float) -> tuple[FloatArray, float]:
        values = np.zeros(_NUMBERS)
        if self._source is not None:
            found = self._source.read_all()
            for place, category in self._places:
                values[place] = found[category][0].values
            return values, now
        for place, category in self._places:
            state = self._device.sensor_status(category, 0)
            if state != SensorStatus.OK:
                raise DeviceError(f"the {category.name} has status {SensorStatus(state).name}")
            values[place] = self._device.read_sensor(category, 0).values
        return values, now


class InertialDevice(PublishingDevice):
    """``inertial``: the server as a device; ``period`` in s (default 0.005), ``strict`` to skip no message."""

    default_period = 0.005
    ros_device, ros_message = "imu_nws_ros", "sensor_msgs/Imu"

    def configure(self, configuration: Property) -> None:
        self._strict = parameters.flag(configuration, "strict")

    def serve(self, device: Device) -> InertialServer:
        sensors = device.view(IMultipleAnalogSensors)  # type: ignore[type-abstract]  # it is only looked for
        return InertialServer(
            sensors, self.port_name, network=self.network, period=self.period, strict=self._strict, outlets=self.outlets
        )


# The client -----------------------------------------------------------------------------------------------------------


class InertialClient(StreamClient[FloatArray], IMultipleAnalogSensors):
    """The four sensors in the twelve numbers of the port ``remote``; they have no names.

    ``local`` is the client's own port, ``carrier`` the carrier of the stream (default tcp), ``timeout`` the greatest
    age in seconds of the robot's clock (default 0.1).
    """

    codec = VECTOR

    def sensors(self, category: SensorCategory) -> Sequence[SensorInfo]:
        return (SensorInfo(""),) if category in ORDER else ()

    def sensor_status(self, category: SensorCategory, index: int) -> SensorStatus:
        """Return the status of the stream, which is the same for all four sensors."""
        self._check(category, index)
        return self.stream_status()

    def read_sensor(self, category: SensorCategory, index: int) -> SensorReading:
        """Return the latest reading. Raises NoAnswerError unless the message has twelve numbers."""
        self._check(category, index)
        latest = self.stream.fresh()
        if latest.value.size != _NUMBERS:
            raise NoAnswerError(f"{self.name}: {latest.value.size} numbers arrived instead of {_NUMBERS}")
        place = ORDER.index(category) * AXES
        return SensorReading(latest.value[place : place + AXES], latest.time)

    def _check(self, category: SensorCategory, index: int) -> None:
        if index != 0 or category not in ORDER:
            raise RefusedError(f"{self.name} has no {category.name} {index}; it has one of each of its four sensors")
