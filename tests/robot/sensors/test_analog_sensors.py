"""Sensors of all categories through the network: the stream, the age of measurements, descriptions."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rtf import clock
from rtf.bottle import Bottle, Property
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from rtf.middleware.types import Stamp, call
from rtf.middleware.types.codecs import RAW
from rtf.robot.devices.analog_sensors_remapper import CATEGORY_TAGS, AnalogSensorsRemapper
from rtf.robot.devices.fake_sensors import FakeImu
from rtf.robot.errors import ConfigurationError, DeviceError, NoAnswerError, RefusedError, StaleStateError
from rtf.robot.interfaces import SensorCategory, SensorInfo, SensorReading, SensorStatus
from rtf.robot.sensors.analog_sensors import (
    AnalogSensorsClient,
    AnalogSensorsDevice,
    AnalogSensorsServer,
    read_metadata,
)
from rtf.robot.sensors.battery import FakeBattery
from rtf.robot.sensors.measurements import SENSOR_MESSAGE
from waiting import eventually

from ..sensor_bench import ManualClock, ScriptedSensors, connect

if TYPE_CHECKING:
    from collections.abc import Iterator

TEMPERATURE = SensorCategory.TEMPERATURE


@pytest.fixture
def device() -> ScriptedSensors:
    """A device with one thermometer."""
    return ScriptedSensors()


@pytest.fixture
def server(network: Network, device: ScriptedSensors) -> Iterator[AnalogSensorsServer]:
    """The server of the device."""
    with closing(AnalogSensorsServer(device, "/imu", network=network, period=0.01, strict=True)) as made:
        yield made


@pytest.fixture
def time() -> Iterator[ManualClock]:
    """The robot's clock, which the test sets."""
    with clock.use(ManualClock()) as made:
        yield made


def make_client(network: Network, **more: object) -> AnalogSensorsClient:
    """Return an open client."""
    made = AnalogSensorsClient("client", network=network)
    made.open(Property({"remote": "/imu", "local": "/me", **more}))
    return made


@pytest.fixture
def client(network: Network, time: ManualClock, server: AnalogSensorsServer) -> Iterator[AnalogSensorsClient]:
    """The client of the server."""
    with closing(make_client(network)) as made:
        yield made


def publish(server: AnalogSensorsServer, now: float) -> None:
    """Publish a message, and wait until the client has it."""
    server.publish(now)
    assert server.wait(10)


def test_messages_are_stamped(network: Network, server: AnalogSensorsServer):
    """Stamps count from 0, and have the time of publishing."""
    with BufferedPort("/reader", SENSOR_MESSAGE, strict=True, network=network) as reader:
        connect(network, "/imu/measures:o", "/reader")
        for now in (1.5, 2.5):
            publish(server, now)
        received = [reader.receive(10) for _ in range(2)]
    assert [Stamp.parse(one.envelope) for one in received] == [Stamp(0, 1.5), Stamp(1, 2.5)]
    assert [reading.values.tolist() for reading in received[0].value[TEMPERATURE]] == [[36.6]]
    assert len(received[0].value) == 12


def test_older_readers_get_ten_categories(network: Network, device: ScriptedSensors):
    """A server with ten categories has ten in its messages and its description."""
    with (
        closing(AnalogSensorsServer(device, "/old", network=network, period=0.01, categories=10)) as server,
        BufferedPort("/reader", SENSOR_MESSAGE, network=network) as reader,
        RpcClient("/rpc", "/old/rpc:o", network=network) as rpc,
    ):
        connect(network, "/old/measures:o", "/reader")
        publish(server, 1.0)
        assert len(reader.read(10)) == 10
        assert len(rpc.call(call("getMetadata"))) == 10


@pytest.mark.parametrize("problem", [SensorStatus.ERROR, SensorStatus.TIMEOUT, OSError("no cable"), DeviceError("off")])
def test_nothing_is_published_while_a_sensor_is_not_well(
    network: Network,
    said: list[str],
    server: AnalogSensorsServer,
    device: ScriptedSensors,
    problem: SensorStatus | Exception,
):
    """A bad status is reported once, with ports and reason; afterwards messages are sent again."""
    with BufferedPort("/reader", SENSOR_MESSAGE, strict=True, network=network) as reader:
        connect(network, "/imu/measures:o", "/reader")
        device.status = problem if isinstance(problem, SensorStatus) else SensorStatus.OK
        device.failure = problem if isinstance(problem, Exception) else None
        for now in (1.0, 2.0, 3.0):
            publish(server, now)
        device.status, device.failure = SensorStatus.OK, None
        publish(server, 4.0)
        assert Stamp.parse(reader.receive(10).envelope) == Stamp(0, 4.0)
        assert reader.pending == 0
    expected = problem.name if isinstance(problem, SensorStatus) else str(problem)
    [sentence] = said
    assert sentence.startswith("/imu: nothing is published")
    assert expected in sentence


def test_status_of_a_client(client: AnalogSensorsClient, server: AnalogSensorsServer, time: ManualClock):
    """The status of all sensors is waiting before the first message, OK while it is fresh, then a time-out."""
    assert client.sensor_status(TEMPERATURE, 0) is SensorStatus.WAITING_FOR_FIRST_READ
    with pytest.raises(StaleStateError, match="no message has arrived at /me/measures:i"):
        client.read_sensor(TEMPERATURE, 0)
    publish(server, time.now())
    assert client.sensor_status(TEMPERATURE, 0) is SensorStatus.OK
    assert client.read_sensor(TEMPERATURE, 0) == SensorReading(np.array([36.6]), 1.0)
    time.sleep(0.015)
    assert client.sensor_status(TEMPERATURE, 0) is SensorStatus.OK
    time.sleep(0.015)
    assert client.sensor_status(TEMPERATURE, 0) is SensorStatus.TIMEOUT
    with pytest.raises(StaleStateError, match=r"0\.030 s old, more than the allowed 0\.02 s"):
        client.read_sensor(TEMPERATURE, 0)
    publish(server, time.now())
    assert client.sensor_status(TEMPERATURE, 0) is SensorStatus.OK


def test_by_the_machines_clock_the_arrival_counts(network: Network, server: AnalogSensorsServer):
    """The age does not depend on the clock of the robot."""
    with closing(make_client(network, timeout=30)) as client:
        publish(server, 12.0)
        assert client.sensor_status(TEMPERATURE, 0) is SensorStatus.OK


def test_what_the_sensors_are_called(client: AnalogSensorsClient):
    """The client has the sensors' names before the first message."""
    assert [*client.sensors(TEMPERATURE)] == [SensorInfo("s0", "frame", "")]
    assert not any(client.sensors(category) for category in SensorCategory if category != TEMPERATURE)


def test_an_external_connection(network: Network, server: AnalogSensorsServer, time: ManualClock):
    """With an external connection no request is sent, and the sensors are those of the message."""
    with closing(make_client(network, externalConnection=True)) as client:
        assert not client.sensors(TEMPERATURE)
        assert not server.heard
        connect(network, "/imu/measures:o", "/me/measures:i")
        publish(server, time.now())
        assert [*client.sensors(TEMPERATURE)] == [SensorInfo("")]
        assert client.read_sensor(TEMPERATURE, 0).values.tolist() == [36.6]
        with pytest.raises(RefusedError):
            client.read_sensor(SensorCategory.SKIN_PATCH, 0)


def test_a_message_without_a_sensor(network: Network, client: AnalogSensorsClient, time: ManualClock):
    """Reading a sensor that is missing in the message raises NoAnswerError."""
    with BufferedPort("/other", SENSOR_MESSAGE, network=network) as other:
        other.add_output("/me/measures:i")
        other.write([[], []], envelope=f"0 {time.now()}", strict=True)
        eventually(lambda: client._stream.latest, "nothing comes")
        with pytest.raises(NoAnswerError, match="has no TEMPERATURE 0"):
            client.read_sensor(TEMPERATURE, 0)


def test_a_server_that_ends(client: AnalogSensorsClient, server: AnalogSensorsServer, time: ManualClock):
    """The measurements of a client become stale when its server ends."""
    publish(server, time.now())
    server.close()
    time.sleep(1.0)
    assert client.sensor_status(TEMPERATURE, 0) is SensorStatus.TIMEOUT


def test_a_client_that_ends(network: Network, server: AnalogSensorsServer):
    """A server has no reader any more when its client ends."""
    make_client(network).close()
    eventually(lambda: not server.heard, "the reader is still there")


def test_no_server(network: Network):
    """A client without a server is not opened, the message names the port, and nothing stays open."""
    with pytest.raises(DeviceError, match="/imu/rpc:o"):
        make_client(network)
    with closing(AnalogSensorsServer(ScriptedSensors(), "/imu", network=network, period=0.01)):
        make_client(network).close()


def test_a_closed_client(network: Network, server: AnalogSensorsServer):
    """Every method of a closed client raises DeviceError."""
    client = make_client(network)
    client.close()
    for asked in (client.sensor_status, client.read_sensor):
        with pytest.raises(DeviceError, match="not open"):
            asked(TEMPERATURE, 0)


@pytest.mark.parametrize(
    "parameters",
    [
        {"remote": None},
        {"remote": "imu"},
        {"timeout": 0},
        {"timeout": "soon"},
        {"carrier": "pigeon"},
        {"externalConnection": "perhaps"},
    ],
)
def test_wrong_parameters_of_a_client(network: Network, parameters: dict[str, object]):
    """The error begins with the parameter."""
    given_ = {key: value for key, value in ({"remote": "/imu"} | parameters).items() if value is not None}
    with pytest.raises(ConfigurationError, match=next(iter(parameters))):
        AnalogSensorsClient("client", network=network).open(Property(given_))


@pytest.mark.parametrize(
    "parameters",
    [{}, {"name": "/x"}, {"name": "x", "period": 10}, {"name": "/x", "period": -1}, {"name": "/x", "period": 1e-9}],
)
def test_wrong_parameters_of_a_server(network: Network, parameters: dict[str, object]):
    """A server needs a name of ports and a period that can be kept."""
    with pytest.raises(ConfigurationError, match=r"name|period"):
        AnalogSensorsDevice("server", network=network).open(Property(parameters))


def test_a_server_serves_one_device_with_sensors(network: Network):
    """No device, two devices, a device without sensors, and a second attachment are refused."""
    imu, battery = FakeImu("imu", network=network), FakeBattery("battery", network=network)
    imu.open(Property())
    device = AnalogSensorsDevice("server", network=network)
    with pytest.raises(DeviceError, match="not open"):
        device.attach({"imu": imu})
    device.open(Property({"name": "/x", "period": 10}))
    with closing(device):
        for attached in ({}, {"a": imu, "b": imu}, {"battery": battery}):
            with pytest.raises(DeviceError, match="server"):
                device.attach(attached)
        device.attach({"imu": imu})
        with pytest.raises(DeviceError, match="detach"):
            device.attach({"imu": imu})
        device.detach()
        device.attach({"imu": imu})


# Peers that make no sense --------------------------------------------------------------------------------------------

words = st.recursive(
    st.one_of(st.integers(-(2**63), 2**63 - 1), st.floats(), st.text(max_size=8), st.binary(max_size=8), st.booleans()),
    lambda inner: st.lists(inner, max_size=4),
    max_leaves=12,
)
bottles = st.lists(words, max_size=6).map(Bottle)
slow = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.mark.fuzz
@slow
@given(st.one_of(bottles, st.lists(st.sampled_from(["getMetadata", "help", "get", 0, ""]), max_size=3).map(Bottle)))
def test_any_question_is_answered(question: Bottle):
    """Any request is answered with the description, help, or [fail]."""
    network = Network(LocalNames(), patience=30)
    with (
        closing(AnalogSensorsServer(ScriptedSensors(), "/imu", network=network, period=1.0)),
        RpcClient("/rpc", "/imu/rpc:o", network=network) as rpc,
    ):
        assert rpc.call(question, timeout=10) is not None
        assert len(rpc.call(call("getMetadata"), timeout=10)) == 12


@pytest.mark.fuzz
@given(bottles)
def test_any_description(answer: Bottle):
    """Any answer is decoded, or raises RobotError."""
    try:
        found = read_metadata(answer, "/imu/rpc:o")
    except NoAnswerError:
        return
    assert all(isinstance(info, SensorInfo) for category in found for info in category)


def test_too_many_sensors():
    """A description of more sensors than a robot can have is refused."""
    with pytest.raises(NoAnswerError, match="at most 10000"):
        read_metadata(Bottle([[["a", "b", "c"]] * 10_001]), "/imu/rpc:o")


def test_a_server_that_answers_nonsense(network: Network):
    """A client with an invalid description is not opened, and nothing stays open."""
    with (
        RpcServer("/imu/rpc:o", lambda question: Bottle([1, 2]), network=network),
        Port("/imu/measures:o", network=network),
        pytest.raises(NoAnswerError, match="/imu/rpc:o"),
    ):
        make_client(network)


@pytest.mark.fuzz
@pytest.mark.parametrize("noise", [b"", b"\xff" * 40, b"\0\1\0\0\xff\xff\xff\x7f", b"\0\1\0\0\1\0\0\0\1\0\0\0\5\0\0\0"])
def test_any_message(network: Network, client: AnalogSensorsClient, said: list[str], noise: bytes):
    """An invalid message closes its connection, and the next valid one is read."""
    with Port("/evil", network=network) as evil:
        evil.add_output("/me/measures:i")
        evil.write(noise, RAW)
        eventually(lambda: any("/evil" in sentence for sentence in said), "nobody complains")
    assert client.sensor_status(TEMPERATURE, 0) is SensorStatus.WAITING_FOR_FIRST_READ


# The remapper --------------------------------------------------------------------------------------------------------


def remapped(devices: dict[str, FakeImu], **names: list[str]) -> AnalogSensorsRemapper:
    """A remapper of some sensors."""
    made = AnalogSensorsRemapper("all")
    made.open(Property({f"{tag}Names": names_ for tag, names_ in names.items()}))
    made.attach(devices)
    return made


def imu(name: str) -> FakeImu:
    """An IMU whose sensors have a name."""
    made = FakeImu(name)
    made.open(Property({"sensorName": name}))
    return made


def test_sensors_in_the_order_of_their_names():
    """The remapper has the sensors that are named for each category, in this order."""
    devices = {"a": imu("left"), "b": imu("right")}
    made = remapped(devices, ThreeAxisGyroscopes=["right", "left"], OrientationSensors=["left"])
    assert [info.name for info in made.sensors(SensorCategory.GYROSCOPE)] == ["right", "left"]
    assert [info.name for info in made.sensors(SensorCategory.ORIENTATION)] == ["left"]
    assert not made.sensors(SensorCategory.ACCELEROMETER)
    devices["b"].state = SensorStatus.OVERFLOW
    assert made.sensor_status(SensorCategory.GYROSCOPE, 0) is SensorStatus.OVERFLOW
    assert made.sensor_status(SensorCategory.GYROSCOPE, 1) is SensorStatus.OK
    made.detach()
    assert not made.sensors(SensorCategory.GYROSCOPE)


@pytest.mark.parametrize("names", [["left"], ["middle"]])
def test_a_name_stands_for_one_sensor(names: list[str]):
    """A name that no device has, or two, is refused."""
    with pytest.raises(DeviceError, match=names[0]):
        remapped({"a": imu("left"), "b": imu("left")}, ThreeAxisGyroscopes=names)


def test_every_category_has_a_tag():
    """Each category has a unique tag in configurations."""
    assert len(set(CATEGORY_TAGS.values())) == len(SensorCategory)
