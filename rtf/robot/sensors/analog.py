"""Analog sensors of the older kind: channels of numbers, as one stream or divided among several."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rtf.bottle import Bottle, Vocab, as_float, as_int, as_string, as_vocab
from rtf.middleware.errors import ConnectError
from rtf.middleware.ports.remote import exists
from rtf.middleware.types import FAIL, VECTOR
from rtf.middleware.wire.contact import Contact
from rtf.robot import parameters
from rtf.robot.errors import ConfigurationError, RefusedError, RobotError
from rtf.robot.interfaces import FloatArray, IAnalogSensor, SensorReading
from rtf.robot.network.publishing_device import PublishingDevice
from rtf.robot.network.stream_client import StreamClient
from rtf.robot.network.stream_server import StreamServer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Property
    from rtf.middleware.ports.network import Network
    from rtf.robot.device import Device
    from rtf.robot.publishing import Outlets

_IANALOG, _ALL, _CHANNEL = Vocab("iana"), Vocab("cal"), Vocab("calc")
#: The answers to a calibration request.
_DONE, _ERROR = 0, 1
_RANGE = 4  # numbers of a channel range
#: The most channels of a server.
MAX_CHANNELS = 100_000


# The server -----------------------------------------------------------------------------------------------------------


class PortChannels(NamedTuple):
    """A port and its channels: ``size`` channels of the sensor from ``first`` on, sent from index ``at`` on."""

    name: str
    first: int
    size: int
    at: int = 0


class AnalogServer(StreamServer[FloatArray]):
    """Publishes a device's channels at ``NAME``, or at the ``ports`` that share them; each has an RPC port ``…/rpc:i``.

    The requests of all RPC ports are for the whole device, as in YARP.

    Raises ConfigurationError for channels that the device does not have, ConnectError and AddressError.
    """

    def __init__(
        self,
        device: IAnalogSensor,
        name: str,
        *,
        network: Network,
        period: float,
        ports: Sequence[PortChannels] = (),
        strict: bool = False,
        outlets: Outlets | None = None,
    ) -> None:
        super().__init__(name, network=network, period=period, strict=strict, outlets=outlets)
        self._device = device
        channels = device.channels()
        self._shares = [*ports] or [PortChannels(name, 0, channels)]
        for share in self._shares:
            if share.first + share.size > channels:
                raise ConfigurationError(f"{share.name} needs more channels than the {channels} of the sensor")
        self._whole = self._shares == [PortChannels(self._shares[0].name, 0, channels)]
        names = [share.name for share in self._shares]
        self.open_ports(names, VECTOR, [f"{one}/rpc:i" for one in names], self._answer)

    def measure(self, now: float) -> tuple[FloatArray, float]:
        return self._device.read().values, now

    def send(self, value: FloatArray, envelope: str) -> None:
        if self._whole:  # the usual case
            self._ports[0].write(value, envelope=envelope)
            return
        for share, port in zip(self._shares, self._ports, strict=True):
            port.write(_shown(value, share), envelope=envelope)

    def _answer(self, request: Bottle) -> object:
        if request.get(0) != _IANALOG:
            return FAIL
        what = as_vocab(request.get(1))
        if what == _ALL:
            values = request[2:]
            return self._calibrate([*enumerate(map(as_float, values))] if len(values) else [(None, None)])
        if what == _CHANNEL and isinstance(request.get(2), int):
            value = request.get(3)
            return self._calibrate([(as_int(request.get(2)), None if value is None else as_float(value))])
        return FAIL

    def _calibrate(self, wanted: Sequence[tuple[int | None, float | None]]) -> Bottle:
        try:
            for channel, value in wanted:
                self._device.calibrate(channel, value)
        except RobotError:
            return Bottle([_ERROR])
        return Bottle([_DONE])


def _shown(values: FloatArray, share: PortChannels) -> FloatArray:
    part = values[share.first : share.first + share.size]
    if share.at == 0:
        return part
    shown = values[:0].copy()
    shown.resize(share.at + share.size)
    shown[share.at :] = part
    return shown


class AnalogDevice(PublishingDevice):
    """``analogServer``: the server as a device of a configuration; ``period`` in ms (default 20).

    ``ports (left right)`` divides the channels. For each name there is a parameter with the first and last channel of
    the port and those of the sensor: ``left 0 5 0 5``. The ports are then ``NAME/left`` and ``NAME/right``; a name that
    begins with ``/`` is used as it is.
    """

    unit = 1e-3
    default_period = 20.0
    ros_device, ros_message = "wrenchStamped_nws_ros", "geometry_msgs/WrenchStamped"

    def configure(self, configuration: Property) -> None:
        self._ports = [
            self._port(configuration, word, self.port_name) for word in parameters.names(configuration, "ports")
        ]

    @staticmethod
    def _port(configuration: Property, word: str, prefix: str) -> PortChannels:
        group = configuration.find_group(word) or Bottle([word])
        inner = group.get(1)
        numbers = inner if isinstance(inner, Bottle) else group.tail()
        sound = len(numbers) == _RANGE and all(isinstance(one, int) and 0 <= one < MAX_CHANNELS for one in numbers)
        at, last_at, first, last = map(as_int, numbers) if sound else (0, 0, 0, -1)
        if not sound or last < first or last_at - at != last - first:
            raise parameters.wrong(
                configuration, word, "it is the channels of the port and those of the sensor, such as (0 5 0 5)"
            )
        name = as_string(group.get(0))
        return PortChannels(name if name.startswith("/") else f"{prefix}/{name}", first, last - first + 1, at)

    def serve(self, device: Device) -> AnalogServer:
        """Open the server. Raises ConnectError for names of existing ports, which it would take over."""
        sensor = device.view(IAnalogSensor)  # type: ignore[type-abstract]  # it is only looked for
        for name in [share.name for share in self._ports] or [self.port_name]:
            for port in (name, f"{name}/rpc:i"):
                if exists(self.network, Contact(port)):
                    raise ConnectError(f"the port {port} exists already")
        return AnalogServer(
            sensor, self.port_name, network=self.network, period=self.period, ports=self._ports, outlets=self.outlets
        )


# The client -----------------------------------------------------------------------------------------------------------


class AnalogClient(StreamClient[FloatArray], IAnalogSensor):
    """``analogsensorclient``: the channels of the port ``remote``, from its latest message.

    ``local`` is the client's own port, ``carrier`` the carrier of the stream (default udp), ``timeout`` the greatest
    age in seconds of the robot's clock (default 0.1).
    """

    codec = VECTOR
    carrier = "udp"
    rpc_ends = ("/rpc:o", "/rpc:i")

    def channels(self) -> int:
        """Return the number of channels; 0 until the first message."""
        latest = self.stream.latest
        return 0 if latest is None else len(latest.value)

    def read(self) -> SensorReading:
        latest = self.stream.fresh()
        return SensorReading(latest.value, latest.time)

    def calibrate(self, channel: int | None = None, value: float | None = None) -> None:
        """Calibrate channels. One value for all channels is sent once for each."""
        if channel is not None:
            words: list[object] = [_CHANNEL, channel] if value is None else [_CHANNEL, channel, float(value)]
        else:
            words = [_ALL] if value is None else [_ALL, *[float(value)] * self.channels()]
        answer = self.rpc.ask(Bottle([_IANALOG, *words]))
        if len(answer) != 1 or answer[0] != 0:
            raise RefusedError(f"{self.rpc.server} does not calibrate: {answer.to_text()[:60]}")
