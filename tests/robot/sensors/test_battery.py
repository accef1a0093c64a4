"""Batteries: the bytes of real ones, the server and the client in both dialects, and the fake one."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING

import pytest

from replaying import VERSIONS, recordings
from rtf.bottle import Bottle, BottleError, Dialect, Property
from rtf.bottle.binary import encode
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.types import call
from rtf.middleware.types.codecs import RAW
from rtf.robot.device import make_device
from rtf.robot.devices.fake_sensors import FakeImu
from rtf.robot.errors import ConfigurationError, DeviceError, NotSupportedError, RefusedError, StaleStateError
from rtf.robot.interfaces import BatteryStatus, IBattery
from rtf.robot.sensors.battery import (
    BATTERY_READING,
    BatteryClient,
    BatteryReading,
    BatteryServer,
    BatteryServerDevice,
    FakeBattery,
    status_of,
)
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.ports.network import Network

    from ..sensor_bench import ManualClock

NAME = "/bot/battery"
#: The parameters of the recorded batteries.
RECORDED = {"charge": 80.0, "voltage": 36.5, "current": 1.25, "temperature": 31.0, "info": "a pack of ten cells"}


@pytest.fixture(params=VERSIONS.values(), ids=VERSIONS)
def spoken(request: pytest.FixtureRequest, network: Network) -> Network:
    """The network in each dialect."""
    return network.in_dialect(request.param)


@pytest.fixture
def battery(stepped: ManualClock) -> FakeBattery:
    """A fake battery that was opened at 100 s."""
    assert stepped.time == 100.0
    made = FakeBattery("battery")
    made.open(Property(RECORDED))
    return made


@pytest.fixture
def server(spoken: Network, battery: FakeBattery) -> Iterator[BatteryServer]:
    """The server of the battery."""
    with closing(BatteryServer(battery, NAME, network=spoken, period=0.1)) as served:
        yield served


@pytest.fixture
def client(spoken: Network, server: BatteryServer) -> Iterator[BatteryClient]:
    """The client of the server."""
    assert server.name == NAME
    made = make_device("battery_nwc_yarp", Property({"remote": NAME, "timeout": 1.0}), network=spoken)
    assert isinstance(made, BatteryClient)
    with closing(made):
        yield made


@pytest.mark.parametrize("version", VERSIONS)
def test_messages_and_answers_have_the_bytes_of_a_real_battery(version: str, network: Network, stepped: ManualClock):
    """Reading and answer have the bytes of YARP's fake battery with the same parameters."""
    recorded, dialect = recordings(version, "battery.json"), VERSIONS[version]
    data = bytes.fromhex(recorded["data"])
    reading = BATTERY_READING.decode(data, dialect)
    assert reading[1:] == (36.5, 1.25, 31.0, BatteryStatus.IN_USE)
    assert 60.0 < reading.charge <= 80.0
    assert b"".join(BATTERY_READING.encode(reading, dialect)) == data
    fake = FakeBattery("battery")
    fake.open(Property(RECORDED))
    with closing(BatteryServer(fake, NAME, network=network.in_dialect(dialect), period=1.0)) as served:
        assert served.name == NAME
        with RpcClient("", f"{NAME}/rpc:i", network=network.in_dialect(dialect)) as peer:
            answer = peer.call(call("getBatteryInfoRPC"), answer=RAW, timeout=10)
    assert answer == bytes.fromhex(recorded["answer"])


def test_a_reading_reaches_the_client(server: BatteryServer, client: BatteryClient, stepped: ManualClock):
    """The client has all values; the description is requested."""
    with pytest.raises(StaleStateError, match="no message has arrived"):
        client.charge()
    assert client.battery_status() is BatteryStatus.TIMEOUT
    server.publish(stepped.now())
    eventually(lambda: client.battery_status() is BatteryStatus.IN_USE, "no reading arrived")
    read = (client.charge(), client.voltage(), client.current(), client.temperature())
    assert read == (80.0, 36.5, 1.25, 31.0)
    assert client.battery_info() == "a pack of ten cells"
    assert client.view(IBattery) is client  # type: ignore[type-abstract]


def test_an_old_reading_is_not_shown(server: BatteryServer, client: BatteryClient, stepped: ManualClock):
    """An old reading has the status of a time-out, and reading it raises an error with the age."""
    server.publish(stepped.now())
    eventually(lambda: client.battery_status() is BatteryStatus.IN_USE, "no reading arrived")
    stepped.sleep(2.0)
    assert client.battery_status() is BatteryStatus.TIMEOUT
    with pytest.raises(StaleStateError, match="more than the allowed 1 s"):
        client.voltage()


def test_nothing_is_published_while_the_battery_cannot_be_read(
    server: BatteryServer, client: BatteryClient, battery: FakeBattery, stepped: ManualClock, said: list[str]
):
    """An error is reported once, and the next good reading is sent."""

    def broken() -> float:
        raise DeviceError("the bus of the battery is silent")

    good, battery.voltage = battery.voltage, broken  # type: ignore[method-assign]
    for _ in range(2):
        server.publish(stepped.now())
    assert [sentence for sentence in said if "bus" in sentence] == [
        f"{NAME}: nothing is published: the bus of the battery is silent"
    ]
    battery.voltage = good  # type: ignore[method-assign]
    server.publish(stepped.now())
    eventually(lambda: client.battery_status() is BatteryStatus.IN_USE, "no reading arrived")


@pytest.mark.parametrize(
    "elements",
    [[], [1.0, 2.0, 3.0, 4.0], [1.0, 2.0, 3.0, 4.0, 7], [1.0, 2.0, 3.0, 4.0, -1], [1.0, "2", 3.0, 4.0, 2], [1.0] * 5],
)
@pytest.mark.parametrize("dialect", VERSIONS.values(), ids=VERSIONS)
def test_other_messages_are_no_readings(elements: list[float | str], dialect: Dialect):
    """Messages with another number or type of elements, or an unknown status, are refused."""
    with pytest.raises(BottleError):
        BATTERY_READING.decode(encode(Bottle(elements), dialect), dialect)


def test_whole_numbers_are_numbers():
    """Integers are accepted, because ``yarp write`` sends 50 as one."""
    assert BATTERY_READING.from_text("50 30 3 20 2") == BatteryReading(50.0, 30.0, 3.0, 20.0, BatteryStatus.IN_USE)


@pytest.mark.parametrize(
    ("charge", "current", "status"),
    [
        (80.0, 2.0, BatteryStatus.IN_USE),
        (80.0, 0.0, BatteryStatus.STANDBY),
        (3.0, -2.0, BatteryStatus.CHARGING),
        (15.0, 2.0, BatteryStatus.LOW),
        (5.0, 0.0, BatteryStatus.CRITICAL),
    ],
)
def test_the_status_follows_from_charge_and_current(charge: float, current: float, status: BatteryStatus):
    """A low battery is low also while nothing draws a current, and one that is charged is charging."""
    assert status_of(charge, current) is status


def test_the_fake_battery_runs_down(battery: FakeBattery, stepped: ManualClock):
    """The fake battery's charge falls by 3 per cent a minute, until it is empty."""
    stepped.sleep(60.0)
    assert battery.charge() == pytest.approx(77.0)
    stepped.sleep(3600.0)
    assert battery.charge() == 0.0
    assert battery.battery_status() is BatteryStatus.CRITICAL


@pytest.mark.parametrize("parameters", [{"charge": "half"}, {"voltage": float("inf")}])
def test_wrong_parameters_of_a_fake(parameters: dict[str, object]):
    """A parameter that is not a number is refused."""
    with pytest.raises(ConfigurationError, match=f"{next(iter(parameters))}.*is not a number"):
        make_device("fakeBattery", Property(parameters))


@pytest.mark.parametrize(
    "parameters",
    [{"name": None}, {"period": 0}, {"enable_shutdown": "true"}, {"enable_log": 1}, {"quitPortName": "/bot/quit"}],
)
def test_wrong_parameters_of_a_server(parameters: dict[str, object]):
    """A parameter that this server does not support is refused, not ignored."""
    given = {key: value for key, value in ({"name": NAME} | parameters).items() if value is not None}
    with pytest.raises(ConfigurationError, match=next(iter(parameters))):
        make_device("battery_nws_yarp", Property(given))


def test_a_server_serves_batteries_only(network: Network):
    """The error names the interface that the device lacks."""
    imu = FakeImu("imu")
    imu.open(Property())
    device = make_device("battery_nws_yarp", Property({"name": NAME}), network=network)
    assert isinstance(device, BatteryServerDevice)
    assert device.period == 1.0
    with closing(device), pytest.raises(DeviceError, match="IBattery"):
        device.attach({"imu": imu})


def test_a_client_needs_its_server(network: Network):
    """A client without a server is not opened, and holds no ports."""
    client = BatteryClient("client", network=network)
    with pytest.raises(DeviceError, match="running"):
        client.open(Property({"remote": NAME}))
    for use in (client.charge, client.battery_info):
        with pytest.raises(DeviceError, match="not open"):
            use()


def test_refusals_have_their_code(server: BatteryServer, client: BatteryClient, battery: FakeBattery):
    """A refusal has the code of the answer, in both dialects."""

    def refuses() -> str:
        raise RefusedError("no")

    def lacks() -> str:
        raise NotSupportedError("no")

    assert server.name == NAME
    for raised in (refuses, lacks):
        battery.battery_info = raised  # type: ignore[method-assign]
        with pytest.raises(RefusedError, match="getBatteryInfoRPC"):
            client.battery_info()
