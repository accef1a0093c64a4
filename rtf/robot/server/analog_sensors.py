"""The sensor server: a stream of readings of all categories, and the names of the sensors on request."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.middleware.types import Function, Record, Service
from rtf.robot.interfaces import IMultipleAnalogSensors, SensorCategory
from rtf.robot.measurements import DeviceMeasurements, IMeasurementsSource
from rtf.robot.sensor_message import SENSOR_MESSAGE, Measurements
from rtf.robot.server.publishing_device import PublishingDevice
from rtf.robot.server.stream_server import StreamServer

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network
    from rtf.robot.device import Device
    from rtf.robot.server.outlets import Outlets


class AnalogSensorsServer(StreamServer[Measurements]):
    """Publishes the sensors of a device at ``NAME/measures:o``; the RPC port is ``NAME/rpc:o``.

    ``categories`` is the number of categories: 12, or 10 for readers up to YARP 3.10. The list of sensors is that of
    the device at construction. Nothing is sent while the status of a sensor is not OK. A device that is an
    IMeasurementsSource is read with one call. Raises ConnectError, AddressError.
    """

    def __init__(
        self,
        device: IMultipleAnalogSensors,
        name: str,
        *,
        network: Network,
        period: float,
        categories: int = len(SensorCategory),
        strict: bool = False,
        outlets: Outlets | None = None,
    ) -> None:
        super().__init__(name, network=network, period=period, strict=strict, outlets=outlets)
        self._source = device if isinstance(device, IMeasurementsSource) else DeviceMeasurements(device, categories)
        self._categories = categories
        self._infos = [[*device.sensors(category)] for category in SensorCategory if category < categories]
        service = Service({"getMetadata": Function(self._metadata)})
        self.open_ports([f"{name}/measures:o"], SENSOR_MESSAGE, f"{name}/rpc:o", service.answer)

    def measure(self, now: float) -> tuple[Measurements, float]:
        return self._source.read_all()[: self._categories], now

    def _metadata(self) -> tuple[object, ...]:
        return tuple(Record(*(Record(*info) for info in infos)) for infos in self._infos)


class AnalogSensorsDevice(PublishingDevice):
    """``multipleanalogsensorsserver``: the server as a device of a configuration; ``period`` (required) is in ms."""

    unit = 1e-3

    def serve(self, device: Device) -> AnalogSensorsServer:
        sensors = device.view(IMultipleAnalogSensors)  # type: ignore[type-abstract]  # it is only looked for
        return AnalogSensorsServer(sensors, self.port_name, network=self.network, period=self.period)
