"""The client of a sensor server: sensors of all categories in another process."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

from rtf.bottle import Bottle
from rtf.middleware.types import call
from rtf.robot import parameters
from rtf.robot.client.latest_message import LatestMessage
from rtf.robot.client.rpc_connection import RpcConnection
from rtf.robot.client.settings import RPC_TIMEOUT, unique_local
from rtf.robot.device import Device
from rtf.robot.errors import DeviceError, NoAnswerError, RefusedError
from rtf.robot.interfaces import IMultipleAnalogSensors, SensorCategory, SensorInfo, SensorReading, SensorStatus
from rtf.robot.sensor_message import MAX_SENSORS, SENSOR_MESSAGE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Property
    from rtf.robot.sensor_message import Measurements

#: Default age after which measurements are stale, in seconds; as in YARP.
TIMEOUT = 0.02
_WORDS = 3  # words of a sensor's description


class AnalogSensorsClient(Device, IMultipleAnalogSensors):
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

    _stream: LatestMessage[Measurements] | None = None
    _opened: ExitStack | None = None

    def open(self, configuration: Property) -> None:
        """Open the client. The server must be running; it is asked for the names of its sensors."""
        source = parameters.port_name(configuration, "remote")
        local = parameters.port_name(configuration, "local", unique_local(source))
        timeout = parameters.positive(configuration, "timeout", TIMEOUT)
        carrier = parameters.carrier(configuration, "tcp")
        external = parameters.flag(configuration, "externalConnection")
        with ExitStack() as opened:
            stream = LatestMessage(
                f"{local}/measures:i", SENSOR_MESSAGE, timeout=timeout, network=self.network, lazily=True
            )
            opened.callback(stream.close)
            self._infos = None if external else self._ask(f"{local}/rpc:i", f"{source}/rpc:o", opened)
            if not external:
                stream.connect(f"{source}/measures:o", carrier)
            self._stream = stream
            self._opened = opened.pop_all()

    def _ask(self, name: str, server: str, opened: ExitStack) -> list[list[SensorInfo]]:
        rpc = RpcConnection(name, server, patience=RPC_TIMEOUT, network=self.network)
        opened.callback(rpc.close)
        return read_metadata(rpc.ask(call("getMetadata")), server)

    def close(self) -> None:
        self._stream = None
        if self._opened is not None:
            self._opened.close()
            self._opened = None

    def sensors(self, category: SensorCategory) -> Sequence[SensorInfo]:
        if self._infos is not None:
            return self._infos[category] if category < len(self._infos) else ()
        latest = self._open_stream().latest
        if latest is None or category >= len(latest.value):
            return ()
        return [SensorInfo("") for _ in latest.value[category]]

    def sensor_status(self, category: SensorCategory, index: int) -> SensorStatus:
        """Return the status of the stream, which is the same for all sensors."""
        stream = self._open_stream()
        age = stream.age()
        if age is None:
            return SensorStatus.WAITING_FOR_FIRST_READ
        self._check(category, index)
        return SensorStatus.TIMEOUT if age > stream.timeout else SensorStatus.OK

    def read_sensor(self, category: SensorCategory, index: int) -> SensorReading:
        """Return the latest reading. Raises NoAnswerError if the message lacks a sensor that the server has."""
        stream = self._open_stream()
        values = stream.fresh().value
        self._check(category, index)
        if category >= len(values) or index >= len(values[category]):
            raise NoAnswerError(f"{self.name}: the newest message to {stream.name} has no {category.name} {index}")
        return values[category][index]

    def _check(self, category: SensorCategory, index: int) -> None:
        count = len(self.sensors(category))
        if not 0 <= index < count:
            raise RefusedError(f"{self.name} has {count} sensors {category.name}, counted from 0, and no {index}")

    def _open_stream(self) -> LatestMessage[Measurements]:
        if self._stream is None:
            raise DeviceError(f"{self.name} is not open")
        return self._stream


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
