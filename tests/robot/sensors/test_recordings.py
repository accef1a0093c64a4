"""Recordings of real IMUs, cameras and their clients, replayed with our servers and clients."""

from __future__ import annotations

import socket
from contextlib import ExitStack, closing
from typing import TYPE_CHECKING

import numpy as np
import pytest

from replaying import VERSIONS, playing, receive, recordings, segments
from rtf.bottle import Bottle, Dialect, Property, Vocab
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from rtf.middleware.types import IMAGE, Image, Stamp
from rtf.middleware.types.codecs import RAW
from rtf.middleware.wire import framing
from rtf.robot.devices.fake_camera import FakeFrameGrabber
from rtf.robot.devices.fake_sensors import FakeImu
from rtf.robot.interfaces import SensorCategory, SensorInfo
from rtf.robot.network.outlets import StampCounter
from rtf.robot.sensors.analog_sensors import AnalogSensorsClient, AnalogSensorsServer
from rtf.robot.sensors.camera import FrameGrabberClient, FrameGrabberServer
from rtf.robot.sensors.measurements import SENSOR_MESSAGE
from waiting import eventually

from ..sensor_bench import ScriptedSensors, connect

if TYPE_CHECKING:
    from replaying import Segment
    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.contact import Contact

RECORDED = {version: recordings(version, "sensors.json") for version in VERSIONS}
#: Requests to cameras. YARP 4 gives no reply to two unknown words; our camera replies [fail].
QUESTIONS = [
    (version, talk)
    for version in VERSIONS
    for talk in RECORDED[version]["camera_questions"]
    if b"get\0widt".hex() not in talk[2][1] or version == "3.12.3"
]
#: The bytes of the three words before a requested image.
_WORDS = 32
_GREETING = 8  # bytes of the number that a port answers first


@pytest.fixture(params=[*VERSIONS])
def version(request: pytest.FixtureRequest, network: Network) -> str:
    """A release of YARP, in whose dialect the network is."""
    network.dialect = VERSIONS[request.param]
    return request.param


def put(contact: Contact, talk: list[Segment]) -> None:
    """Replay the recorded client, and compare the answers; only the number of the port differs."""
    with socket.create_connection((contact.host, contact.port), timeout=10) as connection:
        for number, (way, data) in enumerate(talk):
            if way == ">":
                connection.sendall(data)
                continue
            greeting = number == 1 and data.startswith(b"YA") and len(data) == _GREETING
            assert receive(connection, len(data)) == (framing.yarp_number(contact.port) if greeting else data)


def listen(network: Network, name: str) -> socket.socket:
    """Return a socket that listens where the recorded port of this name is called."""
    listening = socket.create_server(("127.0.0.1", 0))
    listening.settimeout(10)
    host, number = listening.getsockname()
    network.names.register(name, carrier="tcp", host=host, port=number)
    return listening


def messages(talk: list[Segment]) -> list[tuple[str, bytes]]:
    """Yield the envelope and the body of each message of a stream, however the sender has split it into blocks."""
    found = []
    for _, data in (one for one in talk[2:] if one[0] == ">"):
        start = data.index(b"~\0\0\1D ") + 6
        end = data.index(b"\0", start)
        found.append((data[start:end].decode(), data[end + 1 :]))
    return found


# Our servers ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("talk", ["metadata", "imu_help"])
def test_questions_to_an_imu(network: Network, version: str, talk: str):
    """The answers with the description and the help have the same bytes."""
    imu = FakeImu("imu")
    imu.open(Property({"period": 10}))
    with closing(AnalogSensorsServer(imu, "/icubSim/inertial", network=network, period=0.01)):
        put(network.names.query("/icubSim/inertial/rpc:o"), segments(RECORDED[version][talk]))


def test_the_stream_of_an_imu(network: Network, version: str):
    """The answers to a real client's administration and the messages have the same bytes."""
    listed, added = map(segments, RECORDED[version]["administration"])
    talk = segments(RECORDED[version]["measures"])
    sent = messages(talk)
    device = ScriptedSensors(SENSOR_MESSAGE.decode(sent[0][1], network.dialect))
    ours = [(">", framing.front("D", envelope, len(body)) + body) for envelope, body in sent]
    acknowledged = [one for message in ours for one in (message, ("<", framing.ACK))]
    with ExitStack() as opened:
        server = AnalogSensorsServer(device, "/icubSim/inertial", network=network, period=0.01)
        opened.enter_context(closing(server))
        contact = network.names.query("/icubSim/inertial/measures:o")
        listening = opened.enter_context(listen(network, "/cli3/measures:i"))
        put(contact, listed)
        with playing(listening, [*talk[:2], *acknowledged]) as received:
            put(contact, added)
            server._stamps = StampCounter(Stamp.parse(sent[0][0]).count)
            for envelope, body in sent:
                device.measurements = SENSOR_MESSAGE.decode(body, network.dialect)
                server.publish(Stamp.parse(envelope).time)
                assert server.wait(10)
    assert len(received) == len(sent) + 1
    for expected, got in received:
        assert got == expected


@pytest.mark.parametrize(("version", "talk"), QUESTIONS)
def test_questions_to_a_camera(network: Network, version: str, talk: list[list[str]]):
    """The help, and the answers to unknown requests of either version, have the same bytes."""
    network.dialect = VERSIONS[version]
    camera = FakeFrameGrabber("camera")
    camera.open(Property())
    with closing(FrameGrabberServer(camera, "/icubSim/cam/left", network=network, period=0.033)):
        contact = network.names.query("/icubSim/cam/left/rpc")
        put(contact, segments(talk))


@pytest.mark.parametrize(("question", "answer"), recordings("3.12.3", "camera_images.json")["answers"])
def test_an_image_that_is_asked_for(network: Network, question: str, answer: str):
    """A camera of YARP 3 with the recorded image answers with the same bytes, and the client reads the colours."""
    data = bytes.fromhex(answer)
    camera = FakeFrameGrabber("camera")
    camera.open(Property())
    image = IMAGE.decode(data[_WORDS:], Dialect.YARP3)
    camera.image = lambda: (image, 1.0)  # type: ignore[method-assign]
    with (
        closing(FrameGrabberServer(camera, "/cam", network=network, period=0.033)),
        RpcClient("", "/cam/rpc", network=network) as rpc,
        closing(FrameGrabberClient("client", network=network)) as client,
    ):
        assert rpc.call(Bottle.parse(question), answer=RAW, timeout=10) == data
        client.open(Property({"remote": "/cam", "no_stream": True}))
        assert client.image()[0] == image.to("rgb")


def test_the_head_of_an_image(network: Network, version: str):
    """Up to the pixels the first message of a camera is that of a real one, to the byte but for the time."""
    talk = segments(RECORDED[version]["image"])
    [(envelope, body)] = messages(talk)
    ours = framing.front("D", envelope, 60 + 230400) + body
    time = Stamp.parse(envelope).time
    camera = FakeFrameGrabber("camera")
    camera.open(Property())
    camera.image = lambda: (Image(np.zeros((240, 320, 3), np.uint8)), time)  # type: ignore[method-assign]
    with ExitStack() as opened:
        server = FrameGrabberServer(camera, "/icubSim/cam/left", network=network, period=0.033)
        opened.enter_context(closing(server))
        listening = opened.enter_context(listen(network, "/rd4"))
        with playing(listening, [*talk[:2], (">", ours)]) as received:
            connect(network, "/icubSim/cam/left", "/rd4")
            server.publish(1.0)
    for expected, got in received:
        assert got == expected
    assert len(received) == 2


# Our clients ---------------------------------------------------------------------------------------------------------


def test_a_client_of_a_real_imu(network: Network, version: str):
    """Our client sends the bytes of a real one, and has the measurements of the real IMU."""
    asked = segments(RECORDED[version]["metadata"])
    added = segments(RECORDED[version]["administration"][1])
    talk = segments(RECORDED[version]["measures"])
    with ExitStack() as opened:
        places = {}
        for name in ("rpc:o", "measures:o"):
            places[name] = opened.enter_context(listen(network, f"/icubSim/inertial/{name}"))
        questions = opened.enter_context(playing(places["rpc:o"], asked))
        administration = opened.enter_context(playing(places["measures:o"], added))
        client = AnalogSensorsClient("client", network=network)
        client.open(Property({"remote": "/icubSim/inertial", "local": "/cli3", "timeout": 30}))
        with closing(client):
            assert [*client.sensors(SensorCategory.GYROSCOPE)] == [SensorInfo("sensorName", "frameName", "")]
            contact = network.names.query("/cli3/measures:i")
            put(contact, talk)
            last = SENSOR_MESSAGE.decode(messages(talk)[-1][1], network.dialect)
            for category in range(4):
                values, time = client.read_sensor(SensorCategory(category), 0)
                assert values.tolist() == last[category][0].values.tolist()
                assert time == last[category][0].time
    for expected, got in (*questions, *administration):
        assert got == expected
    assert len(questions) == 3


@pytest.mark.parametrize("expected", [Dialect.YARP3, Dialect.YARP4])
def test_an_image_of_a_real_camera(network: Network, version: str, expected: Dialect):
    """The client has the image with its time, also if another dialect was expected."""
    network.dialect = expected
    talk = segments(RECORDED[version]["image"])
    (envelope, body) = messages(talk)[0]
    missing = 60 + 230400 - len(body)
    whole = [*talk[:2], (">", talk[2][1] + bytes(missing)), ("<", framing.ACK)]
    with RpcServer("/icubSim/cam/left/rpc", lambda _: Bottle([Vocab("nak")]), network=network), ExitStack() as opened:
        listening = opened.enter_context(listen(network, "/icubSim/cam/left"))
        reply = b'0 "Added connection from /icubSim/cam/left to fast_tcp://rd4\\r\\n"\r\n<ACK>\r\n'
        added = [(">", b"CONNACK admin\r\n"), ("<", b"Welcome admin\r\n")]
        added += [(">", b'a\r\n[add] "fast_tcp://rd4"\r\n'), ("<", reply)]
        administration = opened.enter_context(playing(listening, added))
        client = opened.enter_context(closing(FrameGrabberClient("client", network=network)))
        client.open(Property({"remote": "/icubSim/cam/left", "local": "/rd4"}))
        put(network.names.query("/rd4"), whole)
        eventually(lambda: client._stream.latest, "no image comes")
        image, time = client.image()
    assert (image.code, image.width, image.height) == ("rgb", 320, 240)
    assert time == Stamp.parse(envelope).time
    for wanted, got in administration:
        assert got == wanted
