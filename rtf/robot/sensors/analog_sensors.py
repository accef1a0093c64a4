"""Sensors of all categories: a stream of their readings, and their names on request."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Bottle
from rtf.middleware.types import Function, Record, Service, call
from rtf.robot import parameters
from rtf.robot.errors import NoAnswerError, RefusedError
from rtf.robot.interfaces import IMultipleAnalogSensors, SensorCategory, SensorInfo, SensorReading, SensorStatus
from rtf.robot.network.publishing_device import PublishingDevice
from rtf.robot.network.stream_client import StreamClient
from rtf.robot.network.stream_server import StreamServer
from rtf.robot.sensors.measurements import (
    MAX_SENSORS,
    SENSOR_MESSAGE,
    DeviceMeasurements,
    IMeasurementsSource,
    Measurements,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Property
    from rtf.middleware.ports.network import Network
    from rtf.robot.device import Device
    from rtf.robot.network.latest_message import LatestMessage
    from rtf.robot.network.stream_client import RpcConnection
    from rtf.robot.publishing import Outlets


_WORDS = 3  # words of a sensor's description


# The server -----------------------------------------------------------------------------------------------------------


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
        return AnalogSensorsServer(
            sensors, self.port_name, network=self.network, period=self.period, outlets=self.outlets
        )


# The client -----------------------------------------------------------------------------------------------------------


class AnalogSensorsClient(StreamClient[Measurements], IMultipleAnalogSensors):
    """``multipleanalogsensorsclient``: the sensors of a server, from its latest message.

    ====================== ======================================================================================
    ``remote``             the name of the server, such as ``/icub/inertial``; required
    ``local``              the prefix of the client's own ports; default: a unique one
    ``timeout``            the greatest age of measurements, in seconds of the robot's clock
    ``carrier``            the carrier of the stream
    ``externalConnection`` ``LOCAL/measures:i`` is connected by another program and the server gets no request: the
                           sensors are those in the latest message, and have no names
    ====================== ======================================================================================
    """

    codec = SENSOR_MESSAGE
    timeout = 0.02  # as in YARP
    ends = ("/measures:i", "/measures:o")
    rpc_ends = ("/rpc:i", "/rpc:o")

    def configure(self, configuration: Property) -> None:
        self._external = parameters.flag(configuration, "externalConnection")
        self._infos: list[list[SensorInfo]] | None = None

    def connect_rpc(self, local: str, remote: str) -> RpcConnection | None:
        """Connect to the server, and ask it for the names of its sensors."""
        rpc = None if self._external else super().connect_rpc(local, remote)
        if rpc is not None:
            try:
                self._infos = read_metadata(rpc.ask(call("getMetadata")), rpc.server)
            except NoAnswerError:
                rpc.close()
                raise
        return rpc

    def connect_stream(self, stream: LatestMessage[Measurements], source: str, carrier: str) -> None:
        if not self._external:
            super().connect_stream(stream, source, carrier)

    def sensors(self, category: SensorCategory) -> Sequence[SensorInfo]:
        if self._infos is not None:
            return self._infos[category] if category < len(self._infos) else ()
        latest = self.stream.latest
        if latest is None or category >= len(latest.value):
            return ()
        return [SensorInfo("") for _ in latest.value[category]]

    def sensor_status(self, category: SensorCategory, index: int) -> SensorStatus:
        """Return the status of the stream, which is the same for all sensors."""
        status = self.stream_status()
        if status is not SensorStatus.WAITING_FOR_FIRST_READ:
            self._check(category, index)
        return status

    def read_sensor(self, category: SensorCategory, index: int) -> SensorReading:
        """Return the latest reading. Raises NoAnswerError if the message lacks a sensor that the server has."""
        values = self.stream.fresh().value
        self._check(category, index)
        if category >= len(values) or index >= len(values[category]):
            raise NoAnswerError(f"{self.name}: the newest message to {self.stream.name} has no {category.name} {index}")
        return values[category][index]

    def _check(self, category: SensorCategory, index: int) -> None:
        count = len(self.sensors(category))
        if not 0 <= index < count:
            raise RefusedError(f"{self.name} has {count} sensors {category.name}, counted from 0, and no {index}")


def read_metadata(answer: Bottle, server: str) -> list[list[SensorInfo]]:
    """Parse the names of the sensors by category. Unknown categories are left out.

    Raises NoAnswerError for an invalid answer.
    """
    found = []
    total = 0
    for category in answer[: len(SensorCategory)]:
        if not isinstance(category, Bottle):
            raise NoAnswerError(f"{server} answers {answer.to_text()[:60]!r} to the request for its sensors")
        total += len(category)
        found.append([_info(sensor, server) for sensor in category])
    if total > MAX_SENSORS:
        raise NoAnswerError(f"{server} has {total} sensors; at most {MAX_SENSORS} are accepted")
    return found


def _info(sensor: object, server: str) -> SensorInfo:
    if isinstance(sensor, Bottle):
        words = [word for word in sensor if isinstance(word, str)]
        if len(words) == len(sensor) == _WORDS:
            return SensorInfo(*words)
    raise NoAnswerError(f"{server} describes a sensor as {str(sensor)[:60]!r}; three texts are needed, the name first")
