"""Sensors of all categories on the network: their measurements as a stream, and on request what they are called."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.middleware.types import Function, Record, Service
from rtf.robot.interfaces import IMultipleAnalogSensors, SensorCategory
from rtf.robot.measurements import DeviceMeasurements, IMeasurementsSource
from rtf.robot.sensor_message import SENSOR_MESSAGE, Measurements
from rtf.robot.server.publishing import PublishingDevice
from rtf.robot.server.streaming import StreamServer

if TYPE_CHECKING:
    from rtf.middleware.network import Network
    from rtf.robot.device import Device
    from rtf.robot.server.outlets import Outlets


class AnalogSensorsServer(StreamServer[Measurements]):
    """Publishes the sensors of a device at ``NAME/measures:o``, and answers at ``NAME/rpc:o``.

    ``categories`` is how many are told of: 12, or 10 for what readers up to YARP 3.10 expect. The sensors of the
    device are those that it has now. While one of them is not well nothing is sent. A device that is an
    IMeasurementsSource is asked for all at once. Raises ConnectError, AddressError.
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
    """``multipleanalogsensorsserver``: the server in a configuration; ``period`` is in ms and must be given."""

    unit = 1e-3

    def serve(self, device: Device) -> AnalogSensorsServer:
        sensors = device.view(IMultipleAnalogSensors)  # type: ignore[type-abstract]  # it is only looked for
        return AnalogSensorsServer(sensors, self.port_name, network=self.network, period=self.period)
