"""Depth cameras: the bytes of real ones, the server and the client in both dialects, the fake one, and point clouds."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from replaying import VERSIONS, recordings
from rtf.bottle import Bottle, BottleError, Dialect, Property, Vocab
from rtf.bottle.binary import decode_from
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from rtf.middleware.types import FAIL, IMAGE, call
from rtf.middleware.types.codecs import RAW
from rtf.robot.device import make_device
from rtf.robot.errors import (
    ConfigurationError,
    DeviceError,
    NoAnswerError,
    RefusedError,
    StaleStateError,
)
from rtf.robot.interfaces import Intrinsics, IRgbdOptics, IRgbdSensor, RgbdPart, RgbdStatus
from rtf.robot.network.camera_optics import intrinsics_of, pinhole, property_of
from rtf.robot.network.stream_client import RpcConnection
from rtf.robot.sensors.point_cloud import points_of
from rtf.robot.sensors.rgbd import FakeDepthCamera, RgbdClient, RgbdServer
from rtf.robot.yarp3.rgbd import RgbdResponder, RgbdWords
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.ports.network import Network
    from rtf.robot.interfaces import FloatArray

    from .sensor_bench import ManualClock

NAME = "/bot/rgbd"
PORT = f"{NAME}/rpc:i"
SMALL = {"width": 8, "height": 4, "near": 0.2, "far": 6.0, "accuracy": 0.001}
#: Further properties of the recorded cameras. They have no field of view in YARP 3.12.3.
RECORDED = Intrinsics(512.0, 512.0, 235.0, 231.0)


@pytest.fixture(params=VERSIONS.values(), ids=VERSIONS)
def spoken(request: pytest.FixtureRequest, network: Network) -> Network:
    """The network in each dialect."""
    return network.in_dialect(request.param)


@pytest.fixture
def camera(stepped: ManualClock) -> FakeDepthCamera:
    """A small fake depth camera, at 100 s."""
    assert stepped.time == 100.0
    made = FakeDepthCamera("camera")
    made.open(Property(SMALL))
    return made


@pytest.fixture
def server(spoken: Network, camera: FakeDepthCamera) -> Iterator[RgbdServer]:
    """The server of the camera."""
    with closing(RgbdServer(camera, NAME, network=spoken, period=0.1)) as served:
        yield served


@pytest.fixture
def client(spoken: Network, server: RgbdServer) -> Iterator[RgbdClient]:
    """The client of the server."""
    assert server.name == NAME
    made = make_device("RGBDSensor_nwc_yarp", Property({"remote": NAME, "timeout": 1.0}), network=spoken)
    assert isinstance(made, RgbdClient)
    with closing(made):
        yield made


class Recorded(FakeDepthCamera):
    """A fake camera with the sizes, angles and projection of the recorded ones."""

    def size(self, part: RgbdPart) -> tuple[int, int]:
        return self.sides

    def field_of_view(self, part: RgbdPart) -> tuple[float, float]:
        if self.angles is None:
            raise RefusedError("it has none")
        return self.angles

    def intrinsics(self, part: RgbdPart) -> Intrinsics:
        return RECORDED

    sides: tuple[int, int] = (8, 4)
    angles: tuple[float, float] | None = None


@pytest.mark.parametrize("version", VERSIONS)
def test_answers_have_the_bytes_of_a_real_camera(version: str, network: Network, stepped: ManualClock):
    """Answers have the recorded bytes, but for projections and descriptions; so have encoded images."""
    assert stepped.time == 100.0
    recorded, dialect = recordings(version, "rgbd.json"), VERSIONS[version]
    camera = Recorded("camera")
    camera.open(Property(SMALL))
    if dialect is Dialect.YARP4:
        camera.sides, camera.angles = (640, 480), (36.0, 50.0)
    spoken = network.in_dialect(dialect)
    with closing(RgbdServer(camera, NAME, network=spoken, period=0.1)), RpcClient("", PORT, network=spoken) as peer:
        for question, answer in recorded["answers"].items():
            asked = call(question) if dialect is Dialect.YARP4 else Bottle.parse(question)
            found = peer.call(asked, answer=RAW, timeout=10)
            assert found is not None
            if "intp" in question or "Intrinsic" in question:
                assert projection_in(found, dialect)[1:] == RECORDED[1:]
            elif "CameraDescription" not in question:  # of the features of a camera, which ours does not have
                assert found.hex() == answer, question
    for port, code in (("rgbImage:o", "rgb"), ("depthImage:o", "dec")):
        data = bytes.fromhex(recorded[port])
        assert data[20:24].rstrip(b"\0").decode() == code
        if len(data) > 60:
            image = IMAGE.decode(data, dialect)
            assert (image.width, image.height, image.code) == (8, 4, code)
            assert b"".join(IMAGE.encode(image, dialect)) == data


def projection_in(data: bytes, dialect: Dialect) -> Intrinsics:
    """Return the projection in an answer."""
    last = decode_from(data, 0, dialect)[0][-1]
    return intrinsics_of(last if isinstance(last, Property) else Property.from_bottle(last))  # type: ignore[arg-type]


@pytest.mark.parametrize("version", VERSIONS)
def test_the_projections_of_a_real_camera_are_read(version: str):
    """A recorded projection is decoded; that of YARP 4.0 is computed from the field of view."""
    answers = recordings(version, "rgbd.json")["answers"]
    data = bytes.fromhex(answers["getDepthIntrinsicParamRPC" if version == "4.0.0" else "[visd] [get] [intp]"])
    found = projection_in(data, VERSIONS[version])
    if version == "4.0.0":  # 36 deg of 640 pixels, 50 deg of 480
        assert found[:4] == pytest.approx(pinhole((640, 480), (36.0, 50.0))[:4])
    else:
        assert found == RECORDED


def test_images_and_optics_reach_the_client(server: RgbdServer, client: RgbdClient, stepped: ManualClock):
    """The client has both images, with one time, and all properties of the optics."""
    with pytest.raises(StaleStateError, match="no message has arrived"):
        client.images()
    server.publish(stepped.now())
    eventually(lambda: all(one.latest for one in client._streams or ()), "no image arrived")
    images = client.images()
    assert (images.colour.code, images.depth.code) == ("rgb", "dec")
    assert images.colour_time == images.depth_time == pytest.approx(100.0, abs=0.04)
    expected = images.colour.pixels.sum(axis=2) / 765
    assert images.depth.pixels.tolist() == [[pytest.approx(one) for one in row] for row in expected]
    for part in RgbdPart:
        assert client.size(part) == (8, 4)
        assert client.field_of_view(part) == pytest.approx((60.0, 60.0))
        assert client.intrinsics(part) == pinhole((8, 4), (60.0, 60.0))
    assert client.clip_planes() == (0.2, 6.0)
    assert client.depth_accuracy() == 0.001
    assert client.extrinsics().tolist() == np.eye(4).tolist()
    assert client.rgbd_status() is RgbdStatus.IN_USE
    assert client.view(IRgbdSensor) is client  # type: ignore[type-abstract]


def test_an_image_is_sent_once(server: RgbdServer, client: RgbdClient, stepped: ManualClock):
    """An image is sent once, and reading it after the timeout raises StaleStateError."""
    server.publish(stepped.now())
    eventually(lambda: all(one.latest for one in client._streams or ()), "no image arrived")
    assert server.measure(stepped.now()) is None
    stepped.sleep(2.0)
    with pytest.raises(StaleStateError, match="more than the allowed 1 s"):
        client.images()
    assert server.measure(stepped.now()) is not None


def test_both_images_may_have_times_of_their_own(spoken: Network, camera: FakeDepthCamera, stepped: ManualClock):
    """Colour and depth images have stamps of their own."""
    images = camera.images()
    camera.images = lambda: images._replace(depth_time=images.colour_time - 0.01)  # type: ignore[method-assign]
    with closing(RgbdServer(camera, NAME, network=spoken, period=0.1)) as server:
        device = make_device("RGBDSensor_nwc_yarp", Property({"remote": NAME}), network=spoken)
        assert isinstance(device, RgbdClient)
        with closing(device):
            server.publish(stepped.now())
            eventually(lambda: all(one.latest for one in device._streams or ()), "no image arrived")
            found = device.images()
    assert found.colour_time - found.depth_time == pytest.approx(0.01)


def test_the_ports_of_yarps_client(spoken: Network, server: RgbdServer):
    """Each port and carrier of the client has a parameter, as in YARP's client."""
    assert server.name == NAME
    ports = {
        "remoteImagePort": f"{NAME}/rgbImage:o", "remoteDepthPort": f"{NAME}/depthImage:o", "remoteRpcPort": PORT,
        "localImagePort": "/mine/image", "localDepthPort": "/mine/depth", "localRpcPort": "/mine/rpc",
        "ImageCarrier": "tcp", "DepthCarrier": "tcp",
    }  # fmt: skip
    with closing(make_device("RGBDSensorClient", Property(ports), network=spoken)) as device:
        assert spoken.names.query("/mine/depth") is not None
        assert device.view(IRgbdOptics).size(RgbdPart.DEPTH) == (8, 4)  # type: ignore[type-abstract]


def test_a_client_needs_its_server(network: Network):
    """A client without a server is not opened, and its methods raise DeviceError."""
    client = RgbdClient("client", network=network)
    with pytest.raises(DeviceError, match="running"):
        client.open(Property({"remote": NAME}))
    with pytest.raises(ConfigurationError, match="remote"):
        client.open(Property({"remoteImagePort": NAME}))
    for use in (client.images, client.clip_planes):
        with pytest.raises(DeviceError, match="not open"):
            use()


def test_refusals_reach_the_client(client: RgbdClient, camera: FakeDepthCamera):
    """A refusal of the device is a RefusedError at the client, in both dialects."""

    def refuses() -> float:
        raise RefusedError("no")

    camera.depth_accuracy = refuses  # type: ignore[method-assign]
    with pytest.raises(RefusedError):
        client.depth_accuracy()


ODD = ["[visd] [is] 1", "[visd] [acrc] [is] wide", "[visd] [acrc] [is]", "[visr] [acrc] [is] 1.0", "7"]


@pytest.mark.parametrize("odd", ODD)
def test_odd_answers_are_no_values(odd: str, network: Network):
    """An unexpected answer of a server of YARP 3 raises NoAnswerError."""
    good = {
        "prot": "[rgdb] [prot] [is] 1 0",
        "acrc": odd,
        "stat": "[rgdb] [stat] [is] 99",
        "ext": "[rgdb] [ext] [is] 1 1 (2.0)",
        "intp": "[visd] [intp] [is] ((focalLengthX 3))",
    }

    def answer(request: Bottle) -> Bottle:
        return Bottle.parse(good.get(str(request.get(2)), "[fail]"))

    with (
        RpcServer(PORT, answer, network=network),
        closing(RpcConnection("/odd/rpc:o", PORT, patience=10.0, network=network)) as rpc,
    ):
        words = RgbdWords(rpc, "camera")
        assert words.protocol() == (1, 0)
        for ask in (words.depth_accuracy, words.rgbd_status, words.extrinsics):
            with pytest.raises(NoAnswerError, match="camera"):
                ask()
        with pytest.raises(NoAnswerError, match="no number focalLengthY"):
            words.intrinsics(RgbdPart.DEPTH)


WORDS = [
    Vocab(word)
    for word in ("visr", "visd", "rgdb", "get", "set", "w", "h", "res", "fov", "intp", "acrc", "clip", "stat")
]


@given(st.lists(st.one_of(st.sampled_from(WORDS), st.integers(-9, 9), st.text(max_size=3)), max_size=5))
def test_every_request_has_an_answer(elements: list[object]):
    """Any request is answered with the words of the vocabulary, [fail] or [nak], without an exception."""
    camera = FakeDepthCamera("camera")
    camera.open(Property(SMALL))
    answer = RgbdResponder(camera).answer(Bottle(elements))
    assert answer in (FAIL, Bottle([Vocab("nak")])) or answer[0] == elements[0]


@given(st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 9))
def test_projections_are_properties(numbers: tuple[float, ...]):
    """A projection is the same after encoding and decoding; one without a required number is an error."""
    fx, fy, cx, cy, *distortion = numbers
    intrinsics = Intrinsics(fx, fy, cx, cy, tuple(distortion))  # type: ignore[arg-type]
    found = property_of(intrinsics)
    assert intrinsics_of(found) == intrinsics
    found.remove("principalPointX")
    with pytest.raises(BottleError, match="principalPointX"):
        intrinsics_of(found)


# Point clouds --------------------------------------------------------------------------------------------------------


@given(
    st.tuples(st.floats(0.3, 3.0), st.floats(-0.4, 0.4), st.floats(-0.4, 0.4)),
    st.tuples(st.integers(1, 12), st.integers(1, 12)),
    st.tuples(st.floats(20.0, 120.0), st.floats(20.0, 120.0)),
)
def test_the_points_of_a_plane_lie_in_it(
    plane: tuple[float, float, float], size: tuple[int, int], angles: tuple[float, float]
):
    """For any camera, points of a plane satisfy its equation, depth = a + b x + c y."""
    projection = pinhole(size, angles)
    x = (np.arange(size[0]) - projection.centre_x) / projection.focal_x
    y = ((np.arange(size[1]) - projection.centre_y) / projection.focal_y)[:, np.newaxis]
    distance, right, down = plane
    depth: FloatArray = distance / (1.0 - right * x - down * y)
    points = points_of(depth, projection).astype(float)
    assert points.shape == (size[1], size[0], 3)
    seen = np.isfinite(points[..., 2])
    assert (seen == (depth > 0)).all()
    px, py, pz = (points[..., axis][seen] for axis in range(3))
    assert pz == pytest.approx(distance + right * px + down * py, rel=1e-4, abs=1e-5)


def test_what_is_not_measured_is_no_point():
    """Depths of 0, NaN, infinity and beyond the clip planes give no point."""
    depth = np.array([[0.0, np.nan, np.inf, 0.1, 1.0, 9.0]], np.float32)
    points = points_of(depth, pinhole((6, 1), (60.0, 10.0)), (0.2, 6.0))
    assert np.isfinite(points[0, :, 2]).tolist() == [False, False, False, False, True, False]
    assert np.isnan(points[0, 0]).all()


def test_the_middle_of_an_image_is_straight_ahead():
    """The optical axis passes between the pixels of an even size; x points right and y down."""
    points = points_of(np.full((2, 2), 2.0, np.float32), pinhole((2, 2), (90.0, 90.0)))
    assert points.mean(axis=(0, 1)).tolist() == [0.0, 0.0, 2.0]
    assert points[0, 1, 0] == 1.0
    assert points[1, 0, 1] == 1.0
