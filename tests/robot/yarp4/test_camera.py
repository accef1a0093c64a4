"""Cameras of YARP 4: the table of their service, the server and the client, with the bytes of a real one."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from replaying import recordings
from rtf.bottle import Bottle, Dialect, Property
from rtf.bottle.binary import decode_from
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from rtf.middleware.types import call
from rtf.middleware.types.codecs import codec_of
from rtf.middleware.types.service import answer as answered
from rtf.robot.devices.fake_camera import FakeFrameGrabber
from rtf.robot.errors import DeviceError, NoAnswerError, NotSupportedError, RefusedError
from rtf.robot.interfaces import CameraFeature
from rtf.robot.sensors.camera import FrameGrabberClient, FrameGrabberServer
from rtf.robot.yarp3.camera import CameraWords
from rtf.robot.yarp4.camera import BY_NAME, MESSAGES, CameraFunctions, CameraService
from rtf.robot.yarp4.values import ReturnValue, read_all, write_all

if TYPE_CHECKING:
    from rtf.robot.interfaces import IFrameGrabberControls

FAILED = "09010000010000006661696c"
#: The calls of a camera of 8 x 4 pixels and its answers, in order.
RECORDED: list[list[str]] = recordings("4.0.0", "camera_service.json")["answers"]
#: The head of an answer with an image, up to the pixels: the code, and the header of the image.
IMAGE_HEAD = 24 + 60
#: Answers of the recorded camera that come from its driver, a stub: it accepts anything, and denies what it has.
_OF_ITS_DRIVER = ("Supported", "Intrinsic", "setRgbFOV", "setRgbRes", " 99", " 9", "Feature2", "has", "Push", "DC1394")


def bytes_of(answer: object) -> bytes:
    """Return the bytes of an answer."""
    return b"".join(codec_of(answer).encode(answer, Dialect.YARP4))


def text_of(answer: object) -> str:
    """Return an answer as text, as tools show it."""
    return decode_from(bytes_of(answer), 0, Dialect.YARP4)[0].to_text()


def make_camera() -> FakeFrameGrabber:
    """Return a camera with the size and the angles of the recorded one."""
    camera = FakeFrameGrabber("camera")
    camera.open(Property({"width": 8, "height": 4, "horizontalFov": 1.0, "verticalFov": 2.0}))
    return camera


def make_service(network: Network, controls: IFrameGrabberControls | None = None) -> CameraService:
    """Return the service of a camera with 20 images a second."""
    return CameraService(make_camera(), controls, 0.05, "/cam/rpc", network=network)


# The server ----------------------------------------------------------------------------------------------------------


def test_answers_have_the_bytes_of_a_real_camera(network: Network):
    """The recorded calls, in order, have the recorded answers; of the image, up to its pixels."""
    camera = make_camera()
    camera.camera_description = lambda: (0, "")  # type: ignore[method-assign]
    service = CameraService(camera, camera, 0.05, "/cam/rpc", network=network)
    compared = 0
    for question, answer in RECORDED:
        if not any(part in question for part in _OF_ITS_DRIVER):
            end = IMAGE_HEAD if "getImage" in question else None
            assert bytes_of(service.answer(Bottle.parse(question)))[:end] == bytes.fromhex(answer)[:end], question
            compared += 1
    assert compared == 18


@pytest.mark.parametrize(("question", "answer"), [(one, answer) for one, answer in RECORDED if answer != FAILED])
def test_every_answer_of_a_real_camera_is_read_and_written_alike(question: str, answer: str):
    """Results that are decoded and encoded again have the same bytes, so the types of the table are right."""
    message = BY_NAME[question.split(maxsplit=1)[0]]
    elements = decode_from(bytes.fromhex(answer), 0, Dialect.YARP4)[0].elements()
    values = read_all(message.gives, elements[1:])
    assert ReturnValue.of(elements[0]) is ReturnValue.OK
    again = (ReturnValue.OK, *write_all(message.gives, values)) if values else ReturnValue.OK
    assert bytes_of(answered(again)).hex() == answer


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        ("getRgbWidthRPC", "([ok]) 8"),
        ("getRgbHeightRPC", "([ok]) 4"),
        ("getRgbResolutionRPC", "([ok]) 8 4"),
        ("getRgbSupportedConfigurationsRPC", "([ok]) ((8 4 20.0 6449010))"),
        ("setRgbResolutionRPC 8 4", "[err2]"),
        ("setRgbFOVRPC 1.0 2.0", "[err2]"),
        ("hasFeatureRPC 0", "([ok]) [ok]"),
        ("hasFeatureRPC 10", "([ok]) [fail]"),
        ("hasFeatureRPC 99", "([err5]) [fail]"),
        ("hasOnOffRPC 0", "([ok]) [ok]"),
        ("hasOnOffRPC 10", "([ok]) [fail]"),
        ("hasAutoRPC 0", "([ok]) [ok]"),
        ("hasManualRPC 0", "([ok]) [ok]"),
        ("hasOnePushRPC 0", "([ok]) [fail]"),
        ("getFeature1RPC 3", "([err5]) 0.0"),
        ("getFeature2RPC 3", "([ok]) 0.5 0.5"),
        ("getFeature1RPC 10", "([err2]) 0.0"),
        ("setFeature1RPC 0 7.0", "[err5]"),
        ("setFeature2RPC 3 0.25 0.5", "[ok]"),
        ("setModeRPC 0 0", "[err5]"),
        ("setModeRPC 0 9", "[err5]"),
        ("setOnePushRPC 0", "[err2]"),
        ("getImageCropRPC 0 ((6 2) (9 3))", "([err5]) ([mat] [rgb] (3 0 8 0 0) {})"),
        ("getImageCropRPC 1 ((6 2) (7 3))", "([err2]) ([mat] [rgb] (3 0 8 0 0) {})"),
        ("getImageCropRPC 0 (6 2 7 3)", "[fail]"),
        ("getFormat7WindowDC1394RPC", "([err6]) 0 0 0 0"),
        ("setPowerDC1394RPC 1", "[err6]"),
        ("[fgi] [get] [w]", "[fail]"),
        ("", "[fail]"),
    ],
)
def test_questions_and_answers(network: Network, question: str, answer: str):
    """Requests without a recording have these answers; error answers have the defaults of all results."""
    camera = make_camera()
    assert text_of(make_service(network, camera).answer(Bottle.parse(question))) == answer


def test_a_part_of_the_image(network: Network):
    """A part is given by two corners, which belong to it."""
    answer = make_service(network).answer(Bottle.parse("getImageCropRPC 0 ((6 2) (5 1))"))
    assert text_of(answer).startswith("([ok]) ([mat] [rgb] (3 16 8 2 2)")


def test_intrinsic_parameters(network: Network):
    """The parameters have the names of YARP 4."""
    answer = decode_from(
        bytes_of(make_service(network).answer(Bottle.parse("getRgbIntrinsicParamRPC"))), 0, Dialect.YARP4
    )[0]
    real = next(answer for question, answer in RECORDED if "Intrinsic" in question)
    names = decode_from(bytes.fromhex(real), 0, Dialect.YARP4)[0][1]
    assert {entry[0] for entry in answer[1]} == {entry[0] for entry in names}


def test_a_camera_without_controls(network: Network):
    """Functions about features are answered as by a real camera without the interface."""
    service = make_service(network)
    assert text_of(service.answer(Bottle.parse("getFeature1RPC 0"))) == "([err6]) 0.0"
    assert text_of(service.answer(Bottle.parse("getRgbMirroringRPC"))) == "([ok]) [fail]"
    assert text_of(service.answer(Bottle.parse("setRgbMirroringRPC 1"))) == "[err2]"


def test_the_version(network: Network):
    """Real clients ask for the version before anything else."""
    assert bytes_of(make_service(network).answer(Bottle(["getRemoteProtocolVersion"]))).hex(" ") == (
        "00 01 00 00 01 00 00 00 00 00 04 00 00 00 00 00"
    )


ARGUMENTS = st.lists(
    st.one_of(
        st.integers(-(2**63), 2**63 - 1),
        st.floats(),
        st.text(max_size=6),
        st.lists(st.lists(st.integers(-9, 99), max_size=3), max_size=3),
    ),
    max_size=4,
)


@pytest.mark.fuzz
@settings(max_examples=80, deadline=None)
@given(st.sampled_from([message.name for message in MESSAGES]), ARGUMENTS)
def test_any_question_is_answered(name: str, arguments: list[object]):
    """The answer is results, a code or [fail], can be encoded, and no exception escapes."""
    said: list[str] = []
    network = Network(LocalNames(), report=said.append)
    assert bytes_of(make_service(network, make_camera()).answer(Bottle([name, *arguments])))
    assert not said


# The client ----------------------------------------------------------------------------------------------------------


def open_client(network: Network) -> FrameGrabberClient:
    """Return a client that requests its images."""
    client = FrameGrabberClient("client", network=network)
    client.open(Property({"remote": "/cam", "no_stream": True}))
    return client


@pytest.mark.parametrize("set_to", [None, *Dialect])
@pytest.mark.parametrize(("protocol", "kind"), [(Dialect.YARP3, CameraWords), (Dialect.YARP4, CameraFunctions)])
def test_the_answer_of_the_server_chooses(network: Network, set_to: Dialect | None, protocol: Dialect, kind: type):
    """The client uses words or functions, and numbers arrive unchanged in every dialect of its network."""
    mine = network if set_to is None else network.in_dialect(set_to)
    theirs = network.in_dialect(Dialect.YARP4) if set_to is None and protocol is Dialect.YARP4 else mine
    with (
        closing(FrameGrabberServer(make_camera(), "/cam", network=theirs, period=0.05, protocol=protocol)),
        closing(open_client(mine)) as client,
    ):
        assert type(client._requests) is kind
        client.set_feature(CameraFeature.GAIN, 0.3)
        assert client.feature(CameraFeature.GAIN) == (0.3,)
        assert client.field_of_view() == (1.0, 2.0)


@pytest.mark.parametrize("dialect", Dialect)
def test_the_server_follows_the_dialect_of_the_network(network: Network, dialect: Dialect):
    """A robot that is started with ``--dialect 4`` has cameras of YARP 4."""
    with (
        closing(FrameGrabberServer(make_camera(), "/cam", network=network.in_dialect(dialect), period=0.05)),
        RpcClient("", "/cam/rpc", network=network) as rpc,
    ):
        answer = rpc.call(call("getWidthRPC"), timeout=10)
    assert answer == Bottle.parse({Dialect.YARP3: "[nak]", Dialect.YARP4: "([ok]) 8"}[dialect])


def test_a_client_of_a_real_camera(network: Network):
    """The client returns what the recorded camera answered."""
    answers = {question.split()[0]: decode_from(bytes.fromhex(one), 0, Dialect.YARP4)[0] for question, one in RECORDED}
    answers["getFeature1RPC"] = Bottle.parse("([ok]) 0.25")  # the last recorded one is a failure
    answers["getHeightRPC"] = Bottle.parse("([ok]) 4")
    with (
        RpcServer("/cam/rpc", lambda request: answers[str(request[0])], network=network.in_dialect(Dialect.YARP4)),
        closing(open_client(network)) as client,
    ):
        assert (client.width(), client.height()) == (8, 4)
        image, time = client.image()
        assert (image.code, image.width, image.height) == ("rgb", 8, 4)
        assert image.pixels.sum(axis=(0, 1)).tolist() == [8 * 255, 0, 0]  # one red line
        assert time > 0
        assert client.field_of_view() == (1.0, 2.0)
        assert client.camera_description() == (0, "")
        assert client.has_feature(CameraFeature.BRIGHTNESS) is False
        client.set_feature(CameraFeature.BRIGHTNESS, 0.25)
        assert client.feature(CameraFeature.BRIGHTNESS) == (0.25,)
        assert client.feature(CameraFeature.WHITE_BALANCE) == (0.2, 0.2)
        assert client.is_active(CameraFeature.BRIGHTNESS) is True
        assert client.is_automatic(CameraFeature.BRIGHTNESS) is True


@pytest.mark.parametrize(
    ("code", "error"),
    [("err1", RefusedError), ("err2", NotSupportedError), ("err3", NoAnswerError), ("err6", NotSupportedError)],
)
def test_errors_of_a_camera(network: Network, code: str, error: type[Exception]):
    """Each code raises its error; *not ready* means that the camera lacks the interface."""
    with (
        RpcServer("/cam/rpc", lambda _request: Bottle.parse(f"([{code}]) [fail]"), network=network),
        closing(open_client(network)) as client,
        pytest.raises(error, match="hasFeatureRPC"),
    ):
        client.has_feature(CameraFeature.GAIN)


def test_a_server_that_is_not_there(network: Network):
    """The client is not opened, and the message names the port."""
    with pytest.raises(DeviceError, match="/cam/rpc"):
        open_client(network)


def test_a_server_without_a_camera_yet(network: Network):
    """A server of YARP 4 gives no reply while it starts; it is not taken for one of YARP 3."""
    with (
        Port("/cam/rpc", lambda _request: None, network=network, outputs=False, rpc=True),
        pytest.raises(DeviceError, match="is its camera attached"),
    ):
        open_client(network)
