"""The client of the oldest inertial sensor server."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from rtf.middleware.types import VECTOR
from rtf.robot import parameters
from rtf.robot.client.latest_message import LatestMessage
from rtf.robot.client.settings import unique_local
from rtf.robot.device import Device
from rtf.robot.errors import DeviceError, NoAnswerError, RefusedError
from rtf.robot.interfaces import IMultipleAnalogSensors, SensorCategory, SensorInfo, SensorReading, SensorStatus
from rtf.robot.server.inertial import AXES, ORDER

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rtf.bottle import Property

#: Default age after which measurements are stale, in seconds.
TIMEOUT = 0.1


class InertialClient(Device, IMultipleAnalogSensors):
    """The four sensors in the twelve numbers of the port ``remote``; they have no names.

    ``local`` is the client's own port, ``carrier`` the carrier of the stream (default tcp), ``timeout`` the greatest
    age in seconds of the robot's clock (default 0.1).
    """

    _stream: LatestMessage[NDArray[Any]] | None = None  # of doubles
    _opened: ExitStack | None = None

    def open(self, configuration: Property) -> None:
        """See Device. The server must be there."""
        source = parameters.port_name(configuration, "remote")
        local = parameters.port_name(configuration, "local", unique_local(source))
        timeout = parameters.positive(configuration, "timeout", TIMEOUT)
        carrier = parameters.carrier(configuration, "tcp")
        with ExitStack() as opened:
            stream = LatestMessage(local, VECTOR, timeout=timeout, network=self.network, lazily=True)
            opened.callback(stream.close)
            stream.connect(source, carrier)
            self._stream, self._opened = stream, opened.pop_all()

    def close(self) -> None:
        self._stream = None
        if self._opened is not None:
            self._opened.close()
            self._opened = None

    def sensors(self, category: SensorCategory) -> Sequence[SensorInfo]:
        return (SensorInfo(""),) if category in ORDER else ()

    def sensor_status(self, category: SensorCategory, index: int) -> SensorStatus:
        """Return the status of the stream, which is the same for all four sensors."""
        self._check(category, index)
        stream = self._open_stream()
        age = stream.age()
        if age is None:
            return SensorStatus.WAITING_FOR_FIRST_READ
        return SensorStatus.TIMEOUT if age > stream.timeout else SensorStatus.OK

    def read_sensor(self, category: SensorCategory, index: int) -> SensorReading:
        """Return the latest reading. Raises NoAnswerError unless the message has twelve numbers."""
        self._check(category, index)
        latest = self._open_stream().fresh()
        if latest.value.size != AXES * len(ORDER):
            raise NoAnswerError(f"{self.name}: {latest.value.size} numbers arrived instead of {AXES * len(ORDER)}")
        place = ORDER.index(category) * AXES
        return SensorReading(
            latest.value[place : place + AXES], latest.at if latest.stamp is None else latest.stamp.time
        )

    def _check(self, category: SensorCategory, index: int) -> None:
        if index != 0 or category not in ORDER:
            raise RefusedError(f"{self.name} has no {category.name} {index}; it has one of each of its four sensors")

    def _open_stream(self) -> LatestMessage[NDArray[Any]]:
        if self._stream is None:
            raise DeviceError(f"{self.name} is not open")
        return self._stream
