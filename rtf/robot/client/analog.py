"""The client of the older sensor server."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from rtf.bottle import Bottle, Vocab
from rtf.middleware.types import VECTOR
from rtf.robot import parameters
from rtf.robot.client.latest_message import LatestMessage
from rtf.robot.client.rpc_connection import RpcConnection
from rtf.robot.client.settings import RPC_TIMEOUT, unique_local
from rtf.robot.device import Device
from rtf.robot.errors import DeviceError, RefusedError
from rtf.robot.interfaces import IAnalogSensor, SensorReading

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.bottle import Property

_IANALOG, _ALL, _CHANNEL = Vocab("iana"), Vocab("cal"), Vocab("calc")
#: Default age after which channels are stale, in seconds.
TIMEOUT = 0.1


class AnalogClient(Device, IAnalogSensor):
    """``analogsensorclient``: the channels of the port ``remote``, from its latest message.

    ``local`` is the client's own port, ``carrier`` the carrier of the stream (default udp), ``timeout`` the greatest
    age in seconds of the robot's clock (default 0.1).
    """

    _stream: LatestMessage[NDArray[Any]] | None = None  # of doubles
    _rpc: RpcConnection | None = None
    _opened: ExitStack | None = None

    def open(self, configuration: Property) -> None:
        """Open the client. The server must be running."""
        source = parameters.port_name(configuration, "remote")
        local = parameters.port_name(configuration, "local", unique_local(source))
        timeout = parameters.positive(configuration, "timeout", TIMEOUT)
        carrier = parameters.carrier(configuration, "udp")
        with ExitStack() as opened:
            stream = LatestMessage(local, VECTOR, timeout=timeout, network=self.network, lazily=True)
            opened.callback(stream.close)
            rpc = RpcConnection(f"{local}/rpc:o", f"{source}/rpc:i", patience=RPC_TIMEOUT, network=self.network)
            opened.callback(rpc.close)
            stream.connect(source, carrier)
            self._stream, self._rpc, self._opened = stream, rpc, opened.pop_all()

    def close(self) -> None:
        self._stream = self._rpc = None
        if self._opened is not None:
            self._opened.close()
            self._opened = None

    def channels(self) -> int:
        """Return the number of channels; 0 until the first message."""
        latest = self._open_stream().latest
        return 0 if latest is None else len(latest.value)

    def read(self) -> SensorReading:
        latest = self._open_stream().fresh()
        return SensorReading(latest.value, latest.at if latest.stamp is None else latest.stamp.time)

    def calibrate(self, channel: int | None = None, value: float | None = None) -> None:
        """Calibrate channels. One value for all channels is sent once for each."""
        rpc = self._rpc
        if rpc is None:
            raise DeviceError(f"{self.name} is not open")
        if channel is not None:
            words: list[object] = [_CHANNEL, channel] if value is None else [_CHANNEL, channel, float(value)]
        else:
            words = [_ALL] if value is None else [_ALL, *[float(value)] * self.channels()]
        answer = rpc.ask(Bottle([_IANALOG, *words]))
        if len(answer) != 1 or answer[0] != 0:
            raise RefusedError(f"{rpc.server} does not calibrate: {answer.to_text()[:60]}")

    def _open_stream(self) -> LatestMessage[NDArray[Any]]:
        if self._stream is None:
            raise DeviceError(f"{self.name} is not open")
        return self._stream
