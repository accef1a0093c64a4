"""Batteries: a fake one, the server and the client, with the messages that they exchange.

Both dialects have the same ports: ``NAME/data:o`` streams the readings, ``NAME/rpc:i`` answers the functions of a
service. The source of their layout is YARP's ``BatteryData.thrift`` and ``IBatteryMsgs.thrift`` (3.12 and 4.0).
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from rtf import clock
from rtf.bottle import Bottle, BottleError, as_string
from rtf.bottle.binary import decode_from, encode_blocks
from rtf.middleware.types.codecs import TextCodec
from rtf.robot import parameters
from rtf.robot.device import Device
from rtf.robot.interfaces import BatteryStatus, IBattery
from rtf.robot.network.publishing_device import PublishingDevice
from rtf.robot.network.stream_client import StreamClient
from rtf.robot.network.stream_server import StreamServer
from rtf.robot.yarp4 import functions as row
from rtf.robot.yarp4.functions import refusal, request_of, result_of
from rtf.robot.yarp4.server import DeviceService
from rtf.robot.yarp4.values import NUMBER, TEXT, WHOLE, ReturnValue, read_all

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Dialect, Property
    from rtf.middleware.ports.network import Network
    from rtf.middleware.types.codecs import Buffer
    from rtf.robot.publishing import Outlets
    from rtf.robot.yarp4.functions import Message

#: The endings of the ports of a server.
DATA, RPC = "data:o", "rpc:i"
#: The current in A below which a battery is neither charged nor discharged, and the charges in per cent below which it
#: is low and critical: those of YARP's fake battery.
STANDBY_CURRENT, LOW, CRITICAL = 0.1, 15.0, 5.0
FULL = 100.0
#: What a battery is asked.
FUNCTION = row.call("getBatteryInfoRPC", IBattery, "battery_info", gives=(TEXT,))


# The messages --------------------------------------------------------------------------------------------------------


class BatteryReading(NamedTuple):
    """A message of the stream, in its order: per cent, V, A (positive while the battery is discharged), °C."""

    charge: float
    voltage: float
    current: float
    temperature: float
    status: BatteryStatus


_LAYOUT = (NUMBER, NUMBER, NUMBER, NUMBER, WHOLE)


class BatteryReadingCodec(TextCodec[BatteryReading]):
    """Codec of readings: a list of four numbers and an integer."""

    def encode(self, value: BatteryReading, dialect: Dialect) -> Sequence[Buffer]:
        *numbers, status = value
        return encode_blocks(Bottle([*map(float, numbers), int(status)]), dialect)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[BatteryReading, int]:
        """Decode a reading. Raises BottleError for other elements, and for a status that does not exist."""
        elements, end = decode_from(data, 0, dialect)
        charge, voltage, current, temperature, status = read_all(_LAYOUT, elements.elements())
        try:
            return BatteryReading(charge, voltage, current, temperature, BatteryStatus(status)), end
        except ValueError:
            raise BottleError(f"a battery has no status {status}") from None


BATTERY_READING = BatteryReadingCodec()


def read_battery(battery: IBattery) -> BatteryReading:
    """Return all measurements of a battery. Raises the errors of its methods."""
    return BatteryReading(
        battery.charge(), battery.voltage(), battery.current(), battery.temperature(), battery.battery_status()
    )


def status_of(charge: float, current: float) -> BatteryStatus:
    """Return the status of a working battery by its charge (per cent) and its current (A)."""
    if current < -STANDBY_CURRENT:
        return BatteryStatus.CHARGING
    if charge <= CRITICAL:
        return BatteryStatus.CRITICAL
    if charge <= LOW:
        return BatteryStatus.LOW
    return BatteryStatus.IN_USE if current > STANDBY_CURRENT else BatteryStatus.STANDBY


# The server ----------------------------------------------------------------------------------------------------------


class BatteryServer(StreamServer[BatteryReading]):
    """Publishes the readings of a battery at ``NAME/data:o``, and describes it at ``NAME/rpc:i``.

    Raises ConnectError and AddressError.
    """

    def __init__(
        self, battery: IBattery, name: str, *, network: Network, period: float, outlets: Outlets | None = None
    ) -> None:
        super().__init__(name, network=network, period=period, outlets=outlets)
        self._battery = battery
        service = DeviceService(
            [FUNCTION], lambda _: battery, name, prototype=_prototype, missing=ReturnValue.NOT_READY, network=network
        )
        self.open_ports([f"{name}/{DATA}"], BATTERY_READING, f"{name}/{RPC}", service.answer)

    def measure(self, now: float) -> tuple[BatteryReading, float]:
        return read_battery(self._battery), now


def _prototype(message: Message) -> str:
    """Return the prototype of the function, which tools show."""
    return f"return_get_BatteryInfo IBatteryMsgs::{message.name}()"


class BatteryServerDevice(PublishingDevice):
    """``battery_nws_yarp``: the server as a device; ``period`` in s (default 1).

    YARP's server can write a log file and shut the machine down when the charge is low; ``enable_log``,
    ``enable_shutdown`` and ``quitPortName`` are refused here.
    """

    default_period = 1.0

    def configure(self, configuration: Property) -> None:
        for key in ("enable_log", "enable_shutdown"):
            if parameters.flag(configuration, key):
                raise parameters.wrong(configuration, key, "this server does not have it; leave it out")
        if configuration.check("quitPortName"):
            raise parameters.wrong(configuration, "quitPortName", "this server does not stop robots; leave it out")

    def serve(self, device: Device) -> BatteryServer:
        battery = device.view(IBattery)  # type: ignore[type-abstract]  # it is only looked for
        return BatteryServer(battery, self.port_name, network=self.network, period=self.period, outlets=self.outlets)


# The client ----------------------------------------------------------------------------------------------------------


class BatteryClient(StreamClient[BatteryReading], IBattery):
    """``battery_nwc_yarp``: the battery of the server ``remote``, from the latest message of its stream.

    ``local`` is the prefix of the client's own ports, ``carrier`` the carrier of the stream (default fast_tcp),
    ``timeout`` the greatest age in seconds of the robot's clock (default 2.5). The methods raise StaleStateError for an
    older message and before the first one; the status is then ``TIMEOUT``.
    """

    codec = BATTERY_READING
    lazily = False
    carrier = "fast_tcp"
    timeout = 2.5  # a server sends one a second by default
    ends = ("/data:i", f"/{DATA}")
    rpc_ends = ("/rpc:o", f"/{RPC}")

    def voltage(self) -> float:
        return self._reading().voltage

    def current(self) -> float:
        return self._reading().current

    def charge(self) -> float:
        return self._reading().charge

    def temperature(self) -> float:
        return self._reading().temperature

    def battery_status(self) -> BatteryStatus:
        age = self.stream.age()
        return BatteryStatus.TIMEOUT if age is None or age > self.stream.timeout else self._reading().status

    def battery_info(self) -> str:
        """Ask the server.

        Raises RefusedError if it refuses, NotSupportedError if it lacks the function, NoAnswerError without an answer.
        """
        rpc = self.rpc
        answer = rpc.ask(request_of(FUNCTION, ()))
        refused = partial(refusal, rpc.server)
        return as_string(result_of(FUNCTION, (), answer.elements(), device=rpc.server, error_of=refused))

    def _reading(self) -> BatteryReading:
        return self.stream.fresh().value


# The fake ------------------------------------------------------------------------------------------------------------


class FakeBattery(Device, IBattery):
    """``fakeBattery``: a battery whose charge is a function of the time alone.

    Its ``voltage`` (V, default 30), ``current`` (A, default 3), ``temperature`` (°C, default 20) and ``info`` are
    constant. Its charge begins at ``charge`` (per cent, default 50) when it is opened, and changes by 3 per cent a
    minute: it falls while the current is positive, and grows while it is negative. So charge and current do not agree.
    """

    def open(self, configuration: Property) -> None:
        number = partial(parameters.number, configuration)
        self._constants = number("voltage", 30.0), number("current", 3.0), number("temperature", 20.0)
        self._initial, self._info = number("charge", 50.0), as_string(configuration.get("info", "a fake battery"))
        self._opened_at = clock.current().now()

    def close(self) -> None:
        """Do nothing: there are no resources."""

    def voltage(self) -> float:
        return self._constants[0]

    def current(self) -> float:
        return self._constants[1]

    def charge(self) -> float:
        direction = (self.current() > STANDBY_CURRENT) - (self.current() < -STANDBY_CURRENT)
        changed = _PER_SECOND * direction * (clock.current().now() - self._opened_at)
        return min(max(self._initial - changed, 0.0), FULL)

    def temperature(self) -> float:
        return self._constants[2]

    def battery_status(self) -> BatteryStatus:
        return status_of(self.charge(), self.current())

    def battery_info(self) -> str:
        return self._info


#: The change of the fake's charge, per cent a second: that of YARP's fake.
_PER_SECOND = 0.05
