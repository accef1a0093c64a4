"""The older servers of sensors: channels of numbers, twelve numbers of an inertial sensor; and the fakes."""

from __future__ import annotations

from contextlib import ExitStack, closing
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf import clock
from rtf.bottle import Bottle, Property, Vocab
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from rtf.middleware.types import VECTOR, Stamp
from rtf.robot.devices.fake_sensors import FakeAnalogSensor, FakeImu
from rtf.robot.errors import ConfigurationError, DeviceError, NoAnswerError, RefusedError, RobotError, StaleStateError
from rtf.robot.interfaces import SensorCategory, SensorReading, SensorStatus
from rtf.robot.sensors.analog import AnalogClient, AnalogDevice, AnalogServer, PortChannels
from rtf.robot.sensors.inertial import InertialClient, InertialServer
from waiting import eventually

from ..sensor_bench import ManualClock, ScriptedSensors, connect

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture
def time() -> Iterator[ManualClock]:
    """The robot's clock, which the test sets."""
    with clock.use(ManualClock()) as made:
        yield made


@pytest.fixture
def sensor() -> FakeAnalogSensor:
    """A sensor with six channels."""
    made = FakeAnalogSensor("ft")
    made.open(Property())
    return made


@pytest.fixture
def server(network: Network, time: ManualClock, sensor: FakeAnalogSensor) -> Iterator[AnalogServer]:
    """The server of the sensor."""
    with closing(AnalogServer(sensor, "/ft", network=network, period=0.02, strict=True)) as made:
        yield made


def make_client(network: Network, **more: object) -> AnalogClient:
    """Return an open client."""
    made = AnalogClient("client", network=network)
    made.open(Property({"remote": "/ft", "local": "/me", **more}))
    return made


@pytest.mark.parametrize("carrier", ["tcp", "fast_tcp", "udp"])
def test_channels_through_the_network(network: Network, server: AnalogServer, time: ManualClock, carrier: str):
    """The client has the values and their time, until they are stale."""
    with closing(make_client(network, carrier=carrier)) as client:
        assert client.channels() == 0
        with pytest.raises(StaleStateError):
            client.read()
        server.publish(time.now())
        eventually(client.channels, "nothing comes")
        values, taken = client.read()
        assert values.tolist() == [40.0, 41.0, 42.0, 43.0, 44.0, 45.0]
        assert taken == 100.0
        time.sleep(1.0)
        with pytest.raises(StaleStateError, match=r"1\.000 s old"):
            client.read()


def test_calibration_through_the_network(
    network: Network, server: AnalogServer, sensor: FakeAnalogSensor, time: ManualClock
):
    """A calibration sets the measurement of one channel, or of all, to zero or to a given value."""
    with closing(make_client(network, carrier="tcp")) as client:
        server.publish(time.now())
        eventually(client.channels, "nothing comes")
        client.calibrate()
        assert sensor.read().values.tolist() == [0.0] * 6
        client.calibrate(value=2.5)
        assert sensor.read().values.tolist() == [2.5] * 6
        client.calibrate(1)
        client.calibrate(2, -1.0)
        assert sensor.read().values.tolist() == [2.5, 0.0, -1.0, 2.5, 2.5, 2.5]
        with pytest.raises(RefusedError, match="does not calibrate"):
            client.calibrate(6)


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        ("[iana] [cal]", "0"),
        ("[iana] [cal] 1.0 2.0", "0"),
        ("[iana] [cal] 1.0 2.0 3.0 4.0 5.0 6.0 7.0", "1"),
        ("[iana] [calc] 3", "0"),
        ("[iana] [calc] 3 0.5", "0"),
        ("[iana] [calc] 9", "1"),
        ("[iana] [calc] -1", "1"),
        ("[iana] [calc]", "[fail]"),
        ("[iana] [bogu]", "[fail]"),
        ("[iana]", "[fail]"),
        ("[cal]", "[fail]"),
        ("hello", "[fail]"),
        ("", "[fail]"),
    ],
)
def test_questions_and_answers(network: Network, server: AnalogServer, question: str, answer: str):
    """A calibration is answered with 0 or 1, anything else with [fail]."""
    with RpcClient("/rpc", "/ft/rpc:i", network=network) as rpc:
        assert rpc.call(Bottle.parse(question), timeout=10) == Bottle.parse(answer)


def test_channels_divided_among_ports(network: Network, sensor: FakeAnalogSensor, time: ManualClock):
    """Each port has its channels in their places, and all ports have the same stamp."""
    device = AnalogDevice("server", network=network)
    configuration = {"name": "/ft", "ports": ["left", "/far"], "left": [0, 3, 0, 3], "/far": [1, 2, 4, 5]}
    device.open(Property(configuration | {"period": 1000}))
    with (
        closing(device),
        BufferedPort("/l", VECTOR, network=network) as left,
        BufferedPort("/r", VECTOR, network=network) as far,
    ):
        assert device._ports == [PortChannels("/ft/left", 0, 4), PortChannels("/far", 4, 2, 1)]
        server = device.serve(sensor)
        with closing(server):
            connect(network, "/ft/left", "/l")
            connect(network, "/far", "/r")
            server.publish(7.0)
            one, other = left.receive(10), far.receive(10)
    assert one.value.tolist() == [40.0, 41.0, 42.0, 43.0]
    assert other.value.tolist() == [0.0, 44.0, 45.0]
    assert Stamp.parse(one.envelope) == Stamp.parse(other.envelope) == Stamp(0, 7.0)


def test_each_share_is_a_sensor_of_its_own_for_clients(network: Network, sensor: FakeAnalogSensor):
    """Each port has a port for requests, which are for the whole device; both are closed with the server."""
    device = AnalogDevice("server", network=network)
    device.open(Property({"name": "/skin", "ports": ["left"], "left": [0, 1, 2, 3], "period": 1000}))
    with closing(device):
        device.attach({"skin": sensor})
        client = AnalogClient("client", network=network)
        client.open(Property({"remote": "/skin/left", "carrier": "tcp"}))
        with closing(client):
            client.calibrate(2)
            eventually(lambda: client.channels() == 2, "no message of the share")
        other = AnalogDevice("other", network=network)
        other.open(Property({"name": "/skin/left"}))
        with closing(other), pytest.raises(DeviceError, match="the port /skin/left exists already"):
            other.attach({"skin": sensor})
    assert network.names.query("/skin/left/rpc:i") is None
    assert network.names.query("/skin/rpc:i") is None


@pytest.mark.parametrize("numbers", [None, [0, 1, 2], [3, 1, 3, 1], [0, 5, 0, 2], [-1, 0, -1, 0], [0, 1, 0, "a"]])
def test_wrong_shares(network: Network, numbers: list[object] | None):
    """A port without valid channels is refused by name."""
    given_ = {"name": "/ft", "ports": ["left"]} | ({} if numbers is None else {"left": numbers})
    with pytest.raises(ConfigurationError, match="left"):
        AnalogDevice("server", network=network).open(Property(given_))


def test_more_channels_than_there_are(network: Network, sensor: FakeAnalogSensor):
    """A share beyond the sensor's channels cannot be served."""
    device = AnalogDevice("server", network=network)
    device.open(Property({"name": "/ft", "ports": ["left"], "left": [0, 6, 0, 6]}))
    with closing(device), pytest.raises(DeviceError, match="/ft/left"):
        device.attach({"ft": sensor})


def test_a_sensor_that_fails(network: Network, said: list[str], server: AnalogServer, sensor: FakeAnalogSensor):
    """An error of the sensor is reported once."""
    sensor.read = lambda: 1 / 0  # type: ignore[method-assign]
    with Port("/reader", lambda delivery: None, network=network):
        connect(network, "/ft", "/reader")
        server.publish(1.0)
        server.publish(2.0)
    assert said == ["/ft: nothing is published: ZeroDivisionError: division by zero"]


values = st.one_of(
    st.integers(-(2**63), 2**63 - 1), st.floats(), st.text(max_size=5), st.lists(st.integers(0, 9), max_size=3)
)
questions = st.builds(
    lambda head, rest: Bottle([*head, *rest]),
    st.lists(st.sampled_from([Vocab("iana"), Vocab("cal"), Vocab("calc")]), max_size=2),
    st.lists(values, max_size=8),
)


@pytest.mark.fuzz
@settings(max_examples=40, deadline=None)
@given(questions, questions)
def test_any_question_and_any_answer(question: Bottle, answer: Bottle):
    """Any request is answered; any answer is accepted, or raises RobotError."""
    said: list[str] = []
    network = Network(LocalNames(), patience=30, report=said.append)
    sensor = FakeAnalogSensor("ft")
    sensor.open(Property())
    with (
        closing(AnalogServer(sensor, "/ft", network=network, period=1.0)),
        RpcClient("/rpc", "/ft/rpc:i", network=network) as rpc,
    ):
        assert rpc.call(question, timeout=10) is not None
    assert not said
    with (
        Port("/ft", network=network),
        RpcServer("/ft/rpc:i", lambda _: answer, network=network),
        closing(make_client(network, carrier="tcp")) as client,
    ):
        try:
            client.calibrate()
        except RobotError:
            return
        assert len(answer) == 1
        assert answer[0] == 0  # whatever kind of number it is


# Twelve numbers ------------------------------------------------------------------------------------------------------


def test_the_order_of_twelve_numbers(network: Network):
    """Roll, pitch and yaw, then the accelerometer, the gyroscope and the magnetometer; zeros where there is none."""
    by_category = [[SensorReading(np.array([c, c + 0.1, c + 0.2]), 1.0)] for c in (1.0, 2.0)]
    sensors = ScriptedSensors([*by_category, [], [SensorReading(np.array([7.0, 8.0, 9.0]), 1.0)]])
    with (
        closing(InertialServer(sensors, "/inertial", network=network, period=0.01)) as server,
        BufferedPort("/reader", VECTOR, network=network) as reader,
    ):
        connect(network, "/inertial", "/reader")
        server.publish(3.0)
        received = reader.receive(10)
    assert received.value.tolist() == [7.0, 8.0, 9.0, 2.0, 2.1, 2.2, 1.0, 1.1, 1.2, 0.0, 0.0, 0.0]
    assert Stamp.parse(received.envelope) == Stamp(0, 3.0)


def test_an_inertial_sensor_that_is_not_well(network: Network, said: list[str]):
    """A bad status is reported once, and nothing is published."""
    imu = FakeImu("imu")
    imu.open(Property())
    imu.state = SensorStatus.ERROR
    with (
        closing(InertialServer(imu, "/inertial", network=network, period=0.01)) as server,
        Port("/reader", lambda delivery: None, network=network),
    ):
        connect(network, "/inertial", "/reader")
        server.publish(1.0)
        server.publish(2.0)
    assert said == ["/inertial: nothing is published: the ORIENTATION has status ERROR"]


def test_another_number_of_numbers(network: Network, time: ManualClock):
    """A message of eleven numbers raises NoAnswerError."""
    with ExitStack() as opened:
        port = opened.enter_context(BufferedPort("/inertial", VECTOR, network=network))
        client = opened.enter_context(closing(InertialClient("client", network=network)))
        client.open(Property({"remote": "/inertial", "local": "/me"}))
        assert client.sensor_status(SensorCategory.GYROSCOPE, 0) is SensorStatus.WAITING_FOR_FIRST_READ
        port.write(np.zeros(11), envelope=f"0 {time.now()}")
        eventually(lambda: client.sensor_status(SensorCategory.GYROSCOPE, 0) is SensorStatus.OK, "nothing comes")
        with pytest.raises(NoAnswerError, match="11 numbers"):
            client.read_sensor(SensorCategory.GYROSCOPE, 0)
        time.sleep(1.0)
        assert client.sensor_status(SensorCategory.GYROSCOPE, 0) is SensorStatus.TIMEOUT


# The fakes -----------------------------------------------------------------------------------------------------------


def test_what_the_fake_imu_shows(time: ManualClock):
    """The fake IMU has a counter on three sensors, and gravity on a body that is pitched by so many degrees."""
    imu = FakeImu("imu")
    imu.open(Property({"period": 1000}))
    time.time = 360.0 + 90.0
    shown = [imu.read_sensor(category, 0).values.tolist() for category in (0, 2, 3)]
    assert shown == [[90.0] * 3] * 3
    assert imu.read_sensor(SensorCategory.ACCELEROMETER, 0).values == pytest.approx([9.81, 0.0, 0.0])
    constant = FakeImu("imu")
    constant.open(Property({"constantValue": 1}))
    assert constant.read_sensor(SensorCategory.GYROSCOPE, 0).values.tolist() == [0.0] * 3
