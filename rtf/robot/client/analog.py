"""The client of the older server of sensors."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from rtf.bottle import Bottle, Vocab
from rtf.middleware.types import VECTOR
from rtf.robot import parameters
from rtf.robot.client.asking import Asker
from rtf.robot.client.newest import Newest
from rtf.robot.client.settings import RPC_TIMEOUT, unique_local
from rtf.robot.device import Device
from rtf.robot.errors import DeviceError, RefusedError
from rtf.robot.interfaces import IAnalogSensor, SensorReading

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.bottle import Property

_IANALOG, _ALL, _CHANNEL = Vocab("iana"), Vocab("cal"), Vocab("calc")
#: Seconds after which channels are too old.
TIMEOUT = 0.1


class AnalogClient(Device, IAnalogSensor):
    """``analogsensorclient``: the channels of the port ``remote``, as its newest message has them.

    ``local`` is the client's own port, ``carrier`` how it is sent (udp without it), ``timeout`` the greatest age, s of
    the robot's clock (0.1 without it).
    """

    _stream: Newest[NDArray[Any]] | None = None  # of doubles
    _asker: Asker | None = None
    _opened: ExitStack | None = None

    def open(self, configuration: Property) -> None:
        """See Device. The server must be there."""
        source = parameters.port_name(configuration, "remote")
        local = parameters.port_name(configuration, "local", unique_local(source))
        timeout = parameters.positive(configuration, "timeout", TIMEOUT)
        carrier = parameters.carrier(configuration, "udp")
        with ExitStack() as opened:
            stream = Newest(local, VECTOR, timeout=timeout, network=self.network, lazily=True)
            opened.callback(stream.close)
            asker = Asker(f"{local}/rpc:o", f"{source}/rpc:i", patience=RPC_TIMEOUT, network=self.network)
            opened.callback(asker.close)
            stream.connect(source, carrier)
            self._stream, self._asker, self._opened = stream, asker, opened.pop_all()

    def close(self) -> None:
        self._stream = self._asker = None
        if self._opened is not None:
            self._opened.close()
            self._opened = None

    def channels(self) -> int:
        """See IAnalogSensor; 0 until the first message has come."""
        came = self._open_stream().came
        return 0 if came is None else len(came.value)

    def read(self) -> SensorReading:
        came = self._open_stream().fresh()
        return SensorReading(came.value, came.at if came.stamp is None else came.stamp.time)

    def calibrate(self, channel: int | None = None, value: float | None = None) -> None:
        """See IAnalogSensor. One value for all channels is sent as that of each."""
        asker = self._asker
        if asker is None:
            raise DeviceError(f"{self.name} is not open")
        if channel is not None:
            words: list[object] = [_CHANNEL, channel] if value is None else [_CHANNEL, channel, float(value)]
        else:
            words = [_ALL] if value is None else [_ALL, *[float(value)] * self.channels()]
        answer = asker.ask(Bottle([_IANALOG, *words]))
        if len(answer) != 1 or answer[0] != 0:
            raise RefusedError(f"{asker.server} does not calibrate: {answer.to_text()[:60]}")

    def _open_stream(self) -> Newest[NDArray[Any]]:
        if self._stream is None:
            raise DeviceError(f"{self.name} is not open")
        return self._stream
