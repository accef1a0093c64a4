"""Depth cameras: a fake one, the server and the client.

In both dialects ``NAME/rgbImage:o`` streams pictures, ``NAME/depthImage:o`` the depth of their pixels in m, and
``NAME/rpc:i`` answers requests: words in YARP 3 (:mod:`rtf.robot.yarp3.rgbd`), functions in YARP 4
(:mod:`rtf.robot.yarp4.rgbd`).
"""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

import numpy as np

from rtf.bottle import Dialect, as_string
from rtf.middleware.types import IMAGE, Image, Stamp
from rtf.robot import parameters
from rtf.robot.device import Device
from rtf.robot.devices.fake_camera import FakeFrameGrabber
from rtf.robot.errors import DeviceError, NoAnswerError
from rtf.robot.interfaces import Intrinsics, IRgbdOptics, IRgbdSensor, RgbdImages, RgbdPart, RgbdStatus
from rtf.robot.network.camera_optics import pinhole
from rtf.robot.network.client_settings import RPC_TIMEOUT, unique_local
from rtf.robot.network.latest_message import LatestMessage
from rtf.robot.network.publishing_device import PublishingDevice
from rtf.robot.network.stream_client import RpcConnection
from rtf.robot.network.stream_server import StreamServer
from rtf.robot.yarp3.rgbd import RgbdResponder, RgbdWords
from rtf.robot.yarp4.camera import has_functions
from rtf.robot.yarp4.rgbd import RgbdFunctions, rgbd_service

if TYPE_CHECKING:
    from rtf.bottle import Property
    from rtf.middleware.ports.network import Network
    from rtf.middleware.types.codecs import Codec
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.network.latest_message import ReceivedValue
    from rtf.robot.publishing import Outlets

#: The endings of the ports of a server.
COLOUR, DEPTH, RPC = "rgbImage:o", "depthImage:o", "rpc:i"
#: The format of depths: a float32 for each pixel.
DEPTH_FORMAT = "dec"
#: Default age in seconds beyond which images are stale, as of other cameras.
TIMEOUT = 2.0
#: The version of the protocol of YARP 3 that this client understands.
_MAJOR = 1


# The server ----------------------------------------------------------------------------------------------------------


class RgbdServer(StreamServer[RgbdImages]):
    """Publishes the images of a depth camera, and answers requests at ``NAME/rpc:i``.

    Images are taken only while there are readers, and each is sent once. ``protocol`` says which requests are answered,
    YARP 3's or YARP 4's; None: those of the network's dialect. Raises ConnectError and AddressError.
    """

    def __init__(
        self,
        sensor: IRgbdSensor,
        name: str,
        *,
        network: Network,
        period: float,
        outlets: Outlets | None = None,
        protocol: Dialect | None = None,
    ) -> None:
        super().__init__(name, network=network, period=period, outlets=outlets)
        self._sensor = sensor
        self._taken: float | None = None
        streams, rpc = [f"{name}/{COLOUR}", f"{name}/{DEPTH}"], f"{name}/{RPC}"
        if (protocol or network.dialect) is Dialect.YARP4:
            functions = rgbd_service(sensor, rpc, network=network)
            self.open_ports(streams, IMAGE, rpc, functions.answer, dialect=Dialect.YARP4)
        else:
            self.open_ports(streams, IMAGE, rpc, RgbdResponder(sensor).answer)

    def measure(self, now: float) -> tuple[RgbdImages, float] | None:  # noqa: ARG002 - the camera knows the time
        images = self._sensor.images()
        if images.colour_time == self._taken:
            return None
        self._taken = images.colour_time
        return images, images.colour_time

    def send(self, value: RgbdImages, envelope: str) -> None:
        colour, depth = self._ports
        if colour.outputs:
            colour.write(value.colour, envelope=envelope)
        if depth.outputs:
            stamp = Stamp.parse(envelope)
            if stamp is not None and value.depth_time != value.colour_time:
                envelope = str(Stamp(stamp.count, value.depth_time))
            depth.write(value.depth, envelope=envelope)


class RgbdServerDevice(PublishingDevice):
    """``RGBDSensor_nws_yarp``: the server as a device; ``period`` in s (default 0.02)."""

    default_period = 0.02

    def serve(self, device: Device) -> RgbdServer:
        sensor = device.view(IRgbdSensor)  # type: ignore[type-abstract]  # it is only looked for
        return RgbdServer(sensor, self.port_name, network=self.network, period=self.period, outlets=self.outlets)


# The client ----------------------------------------------------------------------------------------------------------


class RgbdClient(Device, IRgbdSensor):
    """``RGBDSensor_nwc_yarp``: the depth camera of a server. Images are streamed, everything else is requested.

    Requests are words or functions, by the version of the server.

    ==================================== ==============================================================================
    ``remote``                           the name of the server, such as ``/icub/depthCamera``
    ``local``                            the prefix of the client's own ports; default: a unique name
    ``remoteImagePort``, ``localRpcPort`` … names of single ports, as YARP's client needs all of them
    ``ImageCarrier``, ``DepthCarrier``   the carriers of the streams (default fast_tcp)
    ``timeout``                          the greatest age of images, in seconds of the robot's clock (default 2)
    ==================================== ==============================================================================

    ``images`` returns the latest picture and the latest depth, each with its time; while both are under way, they may
    be of two moments. Raises StaleStateError before the first ones, and for old ones.
    """

    _streams: tuple[LatestMessage[Image], LatestMessage[Image]] | None = None
    _requests: IRgbdOptics | None = None
    _opened: ExitStack | None = None

    def open(self, configuration: Property) -> None:
        """See Device. The server must be there."""
        singles = all(configuration.check(f"remote{which}Port") for which in ("Image", "Depth", "Rpc"))
        remote = parameters.port_name(configuration, "remote", "" if singles else None)
        local = parameters.port_name(configuration, "local", unique_local(remote or "/rgbd"))
        timeout = parameters.positive(configuration, "timeout", TIMEOUT)
        server = parameters.port_name(configuration, "remoteRpcPort", f"{remote}/{RPC}")
        functions = has_functions(server, self.network, patience=RPC_TIMEOUT, function="getRgbWidthRPC")
        network = self.network.in_dialect(Dialect.YARP4) if functions else self.network
        with ExitStack() as opened:
            own = parameters.port_name(configuration, "localRpcPort", f"{local}/rpc:o")
            rpc = RpcConnection(own, server, patience=RPC_TIMEOUT, network=network)
            opened.callback(rpc.close)
            requests = RgbdFunctions(rpc, self.name) if functions else self._words(rpc)

            def stream(which: str, ending: str, codec: Codec[Image]) -> LatestMessage[Image]:
                name = parameters.port_name(configuration, f"local{which}Port", f"{local}/{ending}".replace(":o", ":i"))
                made = LatestMessage(name, codec, timeout=timeout, network=self.network)
                opened.callback(made.close)
                source = parameters.port_name(configuration, f"remote{which}Port", f"{remote}/{ending}")
                made.connect(source, as_string(configuration.get(f"{which}Carrier", "fast_tcp")))
                return made

            self._streams = stream("Image", COLOUR, IMAGE), stream("Depth", DEPTH, IMAGE)
            self._requests, self._opened = requests, opened.pop_all()

    def _words(self, rpc: RpcConnection) -> RgbdWords:
        words = RgbdWords(rpc, self.name)
        major, minor = words.protocol()
        if major != _MAJOR:
            raise DeviceError(f"{rpc.server} has version {major}.{minor} of the protocol, not {_MAJOR}")
        return words

    def close(self) -> None:
        self._streams = self._requests = None
        if self._opened is not None:
            self._opened.close()
            self._opened = None

    @property
    def _remote(self) -> IRgbdOptics:
        if self._requests is None:
            raise DeviceError(f"{self.name} is not open")
        return self._requests

    def images(self) -> RgbdImages:
        if self._streams is None:
            raise DeviceError(f"{self.name} is not open")
        colour, depth = (stream.fresh() for stream in self._streams)
        if depth.value.code != DEPTH_FORMAT:
            raise NoAnswerError(f"{self.name}: a depth is a number of the format dec, not {depth.value.code}")
        return RgbdImages(colour.value, depth.value, _time(colour), _time(depth))

    def size(self, part: RgbdPart) -> tuple[int, int]:
        return self._remote.size(part)

    def field_of_view(self, part: RgbdPart) -> tuple[float, float]:
        return self._remote.field_of_view(part)

    def intrinsics(self, part: RgbdPart) -> Intrinsics:
        return self._remote.intrinsics(part)

    def clip_planes(self) -> tuple[float, float]:
        return self._remote.clip_planes()

    def depth_accuracy(self) -> float:
        return self._remote.depth_accuracy()

    def extrinsics(self) -> FloatArray:
        return self._remote.extrinsics()

    def rgbd_status(self) -> RgbdStatus:
        return self._remote.rgbd_status()


def _time(received: ReceivedValue[Image]) -> float:
    return received.at if received.stamp is None else received.stamp.time


# The fake ------------------------------------------------------------------------------------------------------------


class FakeDepthCamera(Device, IRgbdSensor):
    """``fakeDepthCamera``: the pictures of ``fakeFrameGrabber``, with its parameters; bright pixels are far away.

    The depth of a pixel is its brightness, from 0 m, black, to 1 m, white. ``near`` and ``far`` are the clip planes
    (m, default 0.2 and 6), ``accuracy`` is that of the depth (m, default 0.001).
    """

    def open(self, configuration: Property) -> None:
        self._camera = FakeFrameGrabber(self.name, network=self._given_network)
        self._camera.open(configuration)
        self._planes = tuple(
            parameters.positive(configuration, key, default) for key, default in (("near", 0.2), ("far", 6.0))
        )
        self._accuracy = parameters.positive(configuration, "accuracy", 0.001)

    def close(self) -> None:
        """Do nothing: there are no resources."""

    def images(self) -> RgbdImages:
        colour, time = self._camera.image()
        depth = colour.pixels.sum(axis=2, dtype=np.float32) / np.float32(3 * 255)
        return RgbdImages(colour, Image(depth, DEPTH_FORMAT), time, time)

    def size(self, part: RgbdPart) -> tuple[int, int]:  # noqa: ARG002 - both are the same
        return self._camera.width(), self._camera.height()

    def field_of_view(self, part: RgbdPart) -> tuple[float, float]:  # noqa: ARG002
        return self._camera.field_of_view()

    def intrinsics(self, part: RgbdPart) -> Intrinsics:
        return pinhole(self.size(part), self.field_of_view(part))

    def clip_planes(self) -> tuple[float, float]:
        near, far = self._planes
        return near, far

    def depth_accuracy(self) -> float:
        return self._accuracy

    def extrinsics(self) -> FloatArray:
        return np.eye(4)

    def rgbd_status(self) -> RgbdStatus:
        return RgbdStatus.IN_USE
