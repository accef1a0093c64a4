"""Cameras: the fake one, its server with the vocabulary of YARP, and the client, by the same contract."""

from __future__ import annotations

from contextlib import ExitStack, closing
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rtf import clock
from rtf.bottle import Bottle, Dialect, Property, Vocab
from rtf.bottle.binary import encode
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from rtf.middleware.types import IMAGE, Image, Stamp
from rtf.middleware.types.codecs import RAW
from rtf.robot.devices.fake_camera import FakeFrameGrabber
from rtf.robot.errors import (
    ConfigurationError,
    DeviceError,
    NoAnswerError,
    RefusedError,
    RobotError,
    StaleStateError,
)
from rtf.robot.interfaces import CameraFeature, IFrameGrabber, IFrameGrabberControls
from rtf.robot.network.stream_server import with_error_replies
from rtf.robot.sensors.camera import FrameGrabberClient, FrameGrabberDevice, FrameGrabberServer
from rtf.robot.yarp3.camera import CameraResponder
from waiting import eventually

from ..camera_contract import FrameGrabberContract
from ..sensor_bench import ManualClock, connect

if TYPE_CHECKING:
    from collections.abc import Iterator

SMALL = {"width": 64, "height": 48, "period": 0.002}


def make_camera(**more: object) -> FakeFrameGrabber:
    """A small camera."""
    made = FakeFrameGrabber("camera")
    made.open(Property(SMALL | more))
    return made


def make_client(network: Network, **more: object) -> FrameGrabberClient:
    """Return an open client."""
    made = FrameGrabberClient("client", network=network)
    made.open(Property({"remote": "/cam", "local": "/me", **more}))
    return made


class TestFake(FrameGrabberContract):
    """The fake camera keeps the contract."""

    @pytest.fixture
    def camera(self) -> FakeFrameGrabber:
        """A small camera."""
        return make_camera()

    @pytest.fixture
    def controls(self, camera: FakeFrameGrabber) -> FakeFrameGrabber:
        """The camera has its own controls."""
        return camera


@pytest.mark.parametrize(
    ("dialect", "parameters"),
    [
        (Dialect.YARP3, {"carrier": "tcp"}),
        (Dialect.YARP3, {"carrier": "fast_tcp"}),
        (Dialect.YARP3, {"carrier": "udp"}),
        (Dialect.YARP3, {"no_stream": True}),
        (Dialect.YARP4, {"carrier": "fast_tcp"}),
        (Dialect.YARP4, {"no_stream": True}),
    ],
    ids=str,
)
class TestThroughTheNetwork(FrameGrabberContract):
    """Server and client of either version keep the contract, with images streamed by each carrier, or requested."""

    @pytest.fixture
    def camera(self, network: Network, dialect: Dialect, parameters: dict[str, object]) -> Iterator[FrameGrabberClient]:
        """The client of a served camera."""
        with ExitStack() as opened:
            server = opened.enter_context(closing(FrameGrabberDevice("server", network=network.in_dialect(dialect))))
            server.open(Property({"name": "/cam", "period": 0.002}))
            server.attach({"camera": make_camera()})
            client = opened.enter_context(closing(make_client(network, timeout=30, **parameters)))
            eventually(lambda: client._stream is None or client._stream.latest, "no image comes")
            yield client

    @pytest.fixture
    def controls(self, camera: FrameGrabberClient) -> FrameGrabberClient:
        """The camera has its own controls."""
        return camera


# The fake ------------------------------------------------------------------------------------------------------------


def test_the_picture_of_the_fake():
    """Red grows to the right, green downwards, and the blue line is in the row of the image's number."""
    with clock.use(ManualClock(100.0)) as time:
        camera = make_camera(period=0.5)
        for number in (200, 201):
            image, taken = camera.image()
            assert taken == number / 2
            assert np.flatnonzero(image.pixels[:, 0, 2]).tolist() == [number % 48]
            time.sleep(0.5)
        assert image.pixels[0, 0].tolist()[:2] == [0, 0]
        assert image.pixels[-1, -1].tolist()[:2] == [255, 255]
        camera.set_feature(CameraFeature.MIRROR, 1.0)
        assert (camera.image()[0].pixels[0, 0, 0], camera.image()[0].pixels[0, -1, 0]) == (255, 0)


# The stream ----------------------------------------------------------------------------------------------------------


class StillCamera(IFrameGrabber):
    """A camera with the same image until the test sets another one."""

    def __init__(self, image: Image) -> None:
        self.shown = (image, 1.25)
        self.asked = 0

    def width(self) -> int:
        """See IFrameGrabber."""
        return self.shown[0].width

    def height(self) -> int:
        """See IFrameGrabber."""
        return self.shown[0].height

    def image(self) -> tuple[Image, float]:
        """See IFrameGrabber."""
        self.asked += 1
        return self.shown

    def field_of_view(self) -> tuple[float, float]:
        """See IFrameGrabber."""
        return 60.0, 45.0


GREY = Image(np.arange(12, dtype=np.uint8).reshape(3, 4), "mono")


def test_images_are_taken_for_readers_and_sent_once(network: Network):
    """Without readers no image is taken; the same image is not sent twice; stamps count sent images."""
    camera = StillCamera(GREY)
    with closing(FrameGrabberServer(camera, "/cam", network=network, period=0.01, strict=True)) as server:
        server.publish(5.0)
        assert camera.asked == 0
        with BufferedPort("/reader", IMAGE, strict=True, network=network) as reader:
            connect(network, "/cam", "/reader")
            for now in (6.0, 7.0):
                server.publish(now)
            camera.shown = (GREY, 1.5)
            server.publish(8.0)
            received = [reader.receive(10) for _ in range(2)]
            assert reader.pending == 0
    assert [Stamp.parse(one.envelope) for one in received] == [Stamp(0, 1.25), Stamp(1, 1.5)]
    assert received[0].value == GREY.to("rgb")


def test_raw_images(network: Network):
    """Raw images are sent unchanged, and can be requested."""
    with (
        closing(FrameGrabberServer(StillCamera(GREY), "/cam", network=network, period=0.01, raw=True)) as server,
        BufferedPort("/reader", IMAGE, network=network) as reader,
        RpcClient("/rpc", "/cam/rpc", network=network) as rpc,
    ):
        connect(network, "/cam", "/reader")
        server.publish(1.0)
        assert reader.read(10) == GREY
        answer = rpc.call(Bottle.parse("[fgir] [get] [imgr]"))
        assert answer[:3] == Bottle.parse("[fgir] [imgr] [is]")
        assert IMAGE.decode(encode(answer[3]), network.dialect) == GREY


def test_a_camera_that_fails(network: Network, said: list[str]):
    """An error is reported once, and later images are sent."""
    camera = StillCamera(GREY)
    camera.image = lambda: 1 / 0  # type: ignore[method-assign]
    with (
        closing(FrameGrabberServer(camera, "/cam", network=network, period=0.01)) as server,
        Port("/reader", lambda delivery: None, network=network),
        RpcClient("/rpc", "/cam/rpc", network=network) as rpc,
    ):
        connect(network, "/cam", "/reader")
        server.publish(1.0)
        server.publish(2.0)
        assert said == ["/cam: nothing is published: ZeroDivisionError: division by zero"]
        assert rpc.call(Bottle.parse("[fgi] [get] [imgr]")) == Bottle.parse("[fail]")
        assert rpc.call(Bottle.parse("[fgi] [get] [w]")) == Bottle.parse("[fgi] [w] [is] 4")
    assert len(said) == 2


# The vocabulary ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        ("[fgi] [get] [w]", "[fgi] [w] [is] 64"),
        ("[fgi] [get] [h]", "[fgi] [h] [is] 48"),
        ("fgi get w", "[fgi] [w] [is] 64"),
        ("[fgir] [get] [h]", "[fgir] [h] [is] 48"),
        ("[fgir] [get] [imgr]", "[fail]"),
        ("[fgi] [get] [fgi]", "[fail]"),
        ("[fgi] [set] [w] 3", "[fail]"),
        ("[fgi]", "[fail]"),
        ("[fgi] [get] [crop] 0 (0 0 64 48)", "[fail]"),
        ("[fgi] [get] [crop] 0 (-1 0 2 2)", "[fail]"),
        ("[fgi] [get] [crop] 0 (1 2 3)", "[fail]"),
        ("[fgi] [get] [crop] 1 (1 2 3 4)", "[fail]"),
        ("[visr] [get] [w]", "[visr] [w] [is] 64"),
        ("[visr] [get] [res]", "[visr] [res] [is] 64 48"),
        ("[visr] [get] [fov]", "[visr] [fov] [is] 60.0 60.0"),
        ("[visr] [get] [conf]", "[visr] [conf] [is] 1 64 48 2.0 [rgb]"),
        ("[visr] [get] [mirr]", "[visr] [mirr] [is] 0"),
        ("[visr] [set] [mirr] 1", "[visr] [set] 1"),
        ("[visr] [set] [res] 3 4", "[visr] [set] 0"),
        ("[visr] [set] [fov] 3.0 4.0", "[visr] [set] 0"),
        ("[visr] [set] [w] 4", "[fail]"),
        ("[visr] [get] [bogu]", "[fail]"),
        ("[visr]", "[fail]"),
        ("[fgc] [has] [feat] 0", f"[fgc] [has] [feat] {Vocab('feat').value} 1"),
        ("[fgc] [has] [feat] 10", f"[fgc] [has] [feat] {Vocab('feat').value} 0"),
        ("[fgc] [has] [onof] 0", f"[fgc] [has] [feat] {Vocab('onof').value} 1"),
        ("[fgc] [has] [auto] 0", f"[fgc] [has] [feat] {Vocab('auto').value} 1"),
        ("[fgc] [has] [man] 10", f"[fgc] [has] [feat] {Vocab('man').value} 0"),
        ("[fgc] [has] [onep] 0", f"[fgc] [has] [feat] {Vocab('onep').value} 0"),
        ("[fgc] [has] [bogu] 0", "[fail]"),
        ("[fgc] [has] [feat]", "[fail]"),
        ("[fgc] [get] [feat] 0", "[fgc] [feat] [is] 0.5"),
        ("[fgc] [get] [fea2] 0", "[fail]"),
        ("[fgc] [get] [fea2] 3", "[fgc] [fea2] [is] 0.5 0.5"),
        ("[fgc] [get] [actv] 0", "[fgc] [actv] [is] 1"),
        ("[fgc] [get] [mode] 0", "[fgc] [mode] [is] 1"),
        ("[fgc] [get] [feat] 10", "[fail]"),
        ("[fgc] [get] [feat] 23", "[fail]"),
        ("[fgc] [set] [feat] 0 0.25", "[fgc] [set] 1"),
        ("[fgc] [set] [feat] 0 25", "[fgc] [set] 0"),
        ("[fgc] [set] [feat] 10 0.25", "[fgc] [set] 0"),
        ("[fgc] [set] [feat] 0", "[fail]"),
        ("[fgc] [set] [fea2] 3 0.25 0.5", "[fgc] [set] 1"),
        ("[fgc] [set] [mode] 0 2", "[fgc] [set] 1"),
        ("[fgc] [set] [mode] 0 7", "[fgc] [set] 0"),
        ("[fgc] [set] [actv] 0 0", "[fgc] [set] 1"),
        ("[fgc] [set] [onep] 0", "[fgc] [set] 0"),
        ("[fgc] [get] [camd]", '[fgc] [camd] [is] 0 "a camera that draws its images itself"'),
        ("[fgc] [bogu] [feat] 0", "[fail]"),
        ("[fgfw] [DR2a] 0", "0"),
        ("[fgfw] [DR2O]", "0"),
        ("[fgfw] [bogu]", "[fail]"),
        ("[visd] [get] [w]", "[nak]"),
        ("hello", "[nak]"),
        ("", "[nak]"),
    ],
)
def test_questions_and_answers(network: Network, question: str, answer: str):
    """Each request has the answer of the vocabulary, with its types."""
    camera = make_camera()
    with (
        closing(FrameGrabberServer(camera, "/cam", network=network, period=0.5)),
        RpcClient("/rpc", "/cam/rpc", network=network) as rpc,
    ):
        assert rpc.call(Bottle.parse(question), timeout=10) == Bottle.parse(answer)


def test_a_part_of_the_image():
    """A part includes both corners, which may be given in any order."""
    camera = StillCamera(Image(np.arange(60, dtype=np.uint8).reshape(4, 5, 3), "rgb"))
    responder = CameraResponder(camera, None, 1.0)
    for corners in ("(1 2 3 3)", "(3 3 1 2)", "(1 3 3 2)"):
        answer = responder.answer(Bottle.parse(f"[fgi] [get] [crop] 0 {corners}"))
        assert (answer.fields[3].pixels == camera.shown[0].pixels[2:4, 1:4]).all()


def test_intrinsic_parameters():
    """The parameters are those of a pinhole with the camera's field of view, with YARP's names."""
    answer = CameraResponder(StillCamera(GREY), None, 1.0).answer(Bottle.parse("[visr] [get] [intp]"))
    found = Property.from_bottle(answer[3])
    assert found.find("focalLengthX") == pytest.approx(2 / np.tan(np.radians(30)))
    assert found.find("principalPointX") == 1.5
    assert {"physFocalLength", "focalLengthY", "principalPointY", "distortionModel", "k1", "t2"} <= {*found}


def test_a_camera_without_controls(network: Network):
    """Requests to controls are refused, and the image can be read."""
    with (
        closing(FrameGrabberServer(StillCamera(GREY), "/cam", network=network, period=0.5)),
        closing(make_client(network, no_stream=True)) as client,
    ):
        assert client.image()[0] == GREY.to("rgb")
        for asked in (client.has_feature, client.feature, client.is_active):
            with pytest.raises(RefusedError):
                asked(CameraFeature.GAIN)


bottles = st.lists(
    st.one_of(
        st.sampled_from([Vocab(word) for word in ("fgi", "fgir", "visr", "fgc", "fgfw", "get", "set", "has", "imgr")]),
        st.sampled_from([Vocab(word) for word in ("feat", "fea2", "mirr", "mode", "actv", "camd", "fov", "conf", "w")]),
        st.integers(-(2**63), 2**63 - 1),
        st.floats(),
        st.text(max_size=6),
        st.lists(st.integers(-9, 99), max_size=5),
    ),
    max_size=7,
).map(Bottle)


@pytest.mark.fuzz
@settings(max_examples=120, deadline=None)
@given(bottles)
def test_any_question_is_answered(question: Bottle):
    """Any request is answered, and no exception escapes."""
    said: list[str] = []
    network = Network(LocalNames(), patience=30, report=said.append)
    camera = make_camera()
    assert (
        with_error_replies(CameraResponder(camera, camera, 1.0).answer, port="/cam/rpc", network=network)(question)
        is not None
    )
    assert not said


# The client ----------------------------------------------------------------------------------------------------------


def test_images_grow_old(network: Network):
    """Reading before the first image, or after the timeout, raises StaleStateError."""
    with (
        clock.use(ManualClock()) as time,
        closing(FrameGrabberServer(make_camera(), "/cam", network=network, period=0.01)) as server,
        closing(make_client(network, timeout=0.5)) as client,
    ):
        with pytest.raises(StaleStateError, match="no message has arrived"):
            client.image()
        server.publish(time.now())
        eventually(lambda: client._stream.latest, "no image comes")
        assert client.image()[1] == pytest.approx(100.0, abs=0.01)
        time.sleep(1.0)
        with pytest.raises(StaleStateError, match=r"s old"):
            client.image()


def test_no_server(network: Network):
    """A client without a server is not opened, and holds nothing."""
    with pytest.raises(DeviceError, match="/cam/rpc"):
        make_client(network)


def test_a_closed_client(network: Network):
    """Every method of a closed client raises DeviceError."""
    client = FrameGrabberClient("client", network=network)
    for asked in (client.width, client.image, client.field_of_view):
        with pytest.raises(DeviceError, match="not open"):
            asked()


@pytest.mark.parametrize("parameters", [{"capabilities": "INFRARED"}, {"name": "cam"}, {"period": "often"}])
def test_wrong_parameters(network: Network, parameters: dict[str, object]):
    """The error begins with the parameter."""
    with pytest.raises(ConfigurationError, match=next(iter(parameters))):
        FrameGrabberDevice("server", network=network).open(Property(parameters))


HEADS = ("[fgi] [w] [is]", "[fgi] [imgr] [is]", "[visr] [fov] [is]", "[fgc] [camd] [is]", "[fgc] [feat] [is]", "([ok])")
ANSWERS = st.one_of(
    bottles,
    st.builds(lambda head, rest: Bottle([*Bottle.parse(head), *rest]), st.sampled_from(HEADS), bottles),
)


@pytest.mark.fuzz
@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(["[nak]", "([ok]) 64"]), st.lists(ANSWERS, min_size=6, max_size=6))
def test_any_answer(version: str, answers: list[Bottle]):
    """Any answer gives a value of the right type, or raises RobotError."""
    network = Network(LocalNames(), patience=30)
    left = iter([Bottle.parse(version), *answers])
    with (
        RpcServer("/cam/rpc", lambda question: next(left), network=network),
        closing(make_client(network, no_stream=True)) as client,
    ):
        asked = (
            (client.width, int),
            (client.image, tuple),
            (client.field_of_view, tuple),
            (client.camera_description, tuple),
            (lambda: client.feature(CameraFeature.GAIN), tuple),
            (lambda: client.is_active(CameraFeature.GAIN), bool),
        )
        for ask, kind in asked:
            try:
                assert isinstance(ask(), kind)
            except RobotError:
                continue


def test_an_image_too_large(network: Network):
    """An invalid size of images is refused."""
    with (
        RpcServer("/cam/rpc", lambda question: Bottle.parse("[fgi] [w] [is] 2000000000"), network=network),
        closing(make_client(network, no_stream=True)) as client,
        pytest.raises(NoAnswerError, match="2000000000"),
    ):
        client.width()


def test_any_message(network: Network, said: list[str]):
    """An invalid message closes its connection, and the next image is read."""
    with (
        closing(FrameGrabberServer(make_camera(), "/cam", network=network, period=0.01)),
        closing(make_client(network)) as client,
        Port("/evil", network=network) as evil,
    ):
        evil.add_output("/me")
        evil.write(b"\xff" * 70, RAW)
        eventually(lambda: any("/evil" in sentence for sentence in said), "nobody complains")
        with pytest.raises(StaleStateError):
            client.image()
        assert isinstance(client, IFrameGrabberControls)
