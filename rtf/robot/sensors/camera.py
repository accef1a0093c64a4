"""Cameras: a stream of images, and requests, which are words in YARP 3 and functions in YARP 4."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Dialect, as_string
from rtf.middleware.types import IMAGE, Image
from rtf.robot import parameters
from rtf.robot.errors import NoAnswerError, NotSupportedError
from rtf.robot.interfaces import CameraFeature, IFrameGrabber, IFrameGrabberControls
from rtf.robot.network.client_settings import RPC_TIMEOUT
from rtf.robot.network.publishing_device import PublishingDevice
from rtf.robot.network.stream_client import RpcConnection, StreamClient
from rtf.robot.network.stream_server import StreamServer
from rtf.robot.yarp3.camera import CameraResponder, CameraWords
from rtf.robot.yarp4.camera import CameraFunctions, CameraService, has_functions

if TYPE_CHECKING:
    from rtf.bottle import Property
    from rtf.middleware.ports.network import Network
    from rtf.robot.device import Device
    from rtf.robot.network.latest_message import LatestMessage
    from rtf.robot.publishing import Outlets

_CAPABILITIES = ("COLOR", "RAW")


_MAX_SIDE = 1 << 16


# The server -----------------------------------------------------------------------------------------------------------


class FrameGrabberServer(StreamServer[Image]):
    """Publishes the images of a camera at ``NAME``, stamped with their time; the RPC port is ``NAME/rpc``.

    An image is taken only while there are readers, and sent once. ``raw`` sends it unchanged; otherwise it is converted
    to ``rgb``. ``controls`` are the settings of the camera, None if it has none. ``protocol``: whose requests are
    answered, YARP 3's or YARP 4's; None: those of the network's dialect. Raises ConnectError and AddressError.
    """

    def __init__(
        self,
        device: IFrameGrabber,
        name: str,
        *,
        network: Network,
        period: float,
        controls: IFrameGrabberControls | None = None,
        raw: bool = False,
        strict: bool = False,
        outlets: Outlets | None = None,
        protocol: Dialect | None = None,
    ) -> None:
        super().__init__(name, network=network, period=period, strict=strict, outlets=outlets)
        self._device = device
        self._raw = raw
        self._taken: float | None = None
        if controls is None and isinstance(device, IFrameGrabberControls):
            controls = device
        if (protocol or network.dialect) is Dialect.YARP4:
            functions = CameraService(device, controls, period, f"{name}/rpc", network=network)
            self.open_ports([name], IMAGE, f"{name}/rpc", functions.answer, dialect=Dialect.YARP4)
        else:
            self.open_ports([name], IMAGE, f"{name}/rpc", CameraResponder(device, controls, period).answer)

    def measure(self, now: float) -> tuple[Image, float] | None:  # noqa: ARG002 - the camera knows when it was taken
        image, taken = self._device.image()
        if taken == self._taken:
            return None
        self._taken = taken
        return image if self._raw else image.to("rgb"), taken


class FrameGrabberDevice(PublishingDevice):
    """``frameGrabber_nws_yarp``: the server as a device of a configuration.

    ``name`` (default ``/grabber``); ``period`` in s (default 0.033); ``capabilities``: COLOR or RAW; ``no_drop``: no
    image is skipped, the camera waits for slow readers.
    """

    default_name = "/grabber"
    default_period = 0.033
    ros_device, ros_message = "frameGrabber_nws_ros", "sensor_msgs/Image"

    def configure(self, configuration: Property) -> None:
        capability = as_string(configuration.get("capabilities", "COLOR"))
        if capability not in _CAPABILITIES:
            raise parameters.wrong(configuration, "capabilities", f"it is COLOR or RAW, not {capability!r}")
        self._raw = capability == "RAW"
        self._strict = parameters.flag(configuration, "no_drop")

    def serve(self, device: Device) -> FrameGrabberServer:
        camera = device.view(IFrameGrabber)  # type: ignore[type-abstract]  # it is only looked for
        try:
            controls = device.view(IFrameGrabberControls)  # type: ignore[type-abstract]  # likewise
        except NotSupportedError:
            controls = None
        return FrameGrabberServer(
            camera,
            self.port_name,
            network=self.network,
            period=self.period,
            controls=controls,
            raw=self._raw,
            strict=self._strict,
            outlets=self.outlets,
        )


# The client -----------------------------------------------------------------------------------------------------------


class FrameGrabberClient(StreamClient[Image], IFrameGrabber, IFrameGrabberControls):
    """``frameGrabber_nwc_yarp``: the camera of a server. Images are streamed, everything else is requested.

    Requests are words or functions, by the version of the server.

    ============= ==============================================================================================
    ``remote``    the name of the server, such as ``/icub/cam/left``; required
    ``local``     the client's own port; default: a unique name
    ``carrier``   the carrier of the images (default fast_tcp)
    ``no_stream`` images are requested, too
    ``timeout``   the greatest age of an image, in seconds of the robot's clock (default 2)
    ============= ==============================================================================================
    """

    codec = IMAGE
    lazily = False
    carrier = "fast_tcp"
    timeout = 2.0  # the slowest cameras give one image a second

    def configure(self, configuration: Property) -> None:
        self._streamed = not parameters.flag(configuration, "no_stream")

    def connect_rpc(self, local: str, remote: str) -> RpcConnection:
        """Ask the server for its version, and connect to it."""
        server = f"{remote}/rpc"
        functions = has_functions(server, self.network, patience=RPC_TIMEOUT)
        network = self.network.in_dialect(Dialect.YARP4) if functions else self.network
        rpc = RpcConnection(f"{local}/rpc", server, patience=RPC_TIMEOUT, network=network)
        self._requests = CameraFunctions(rpc, self.name) if functions else CameraWords(rpc, self.name)
        return rpc

    def open_stream(self, name: str, timeout: float) -> LatestMessage[Image] | None:
        return super().open_stream(name, timeout) if self._streamed else None

    @property
    def _remote(self) -> CameraWords | CameraFunctions:
        if self._rpc is None:
            raise self.not_open()
        return self._requests

    # The image -------------------------------------------------------------------------------------------------------

    def width(self) -> int:
        return self._side(self._remote.width(), "width")

    def height(self) -> int:
        return self._side(self._remote.height(), "height")

    def _side(self, size: int, what: str) -> int:
        if not 0 <= size <= _MAX_SIDE:
            raise NoAnswerError(f"{self.name}: {size} is not a valid {what} of an image")
        return size

    def image(self) -> tuple[Image, float]:
        """Return the latest image and its time. Without a stream the time is that of the request.

        Raises StaleStateError if no image has arrived yet, or the latest is too old.
        """
        if self._stream is None:
            return self._remote.image()
        latest = self.stream.fresh()
        return latest.value, latest.time

    def field_of_view(self) -> tuple[float, float]:
        return self._remote.field_of_view()

    # Controls --------------------------------------------------------------------------------------------------------

    def camera_description(self) -> tuple[int, str]:
        return self._remote.camera_description()

    def has_feature(self, feature: CameraFeature) -> bool:
        return self._remote.has_feature(feature)

    def feature(self, feature: CameraFeature) -> tuple[float, ...]:
        return self._remote.feature(feature)

    def set_feature(self, feature: CameraFeature, *values: float) -> None:
        self._remote.set_feature(feature, *values)

    def is_active(self, feature: CameraFeature) -> bool:
        return self._remote.is_active(feature)

    def set_active(self, feature: CameraFeature, *, active: bool) -> None:
        self._remote.set_active(feature, active=active)

    def is_automatic(self, feature: CameraFeature) -> bool:
        return self._remote.is_automatic(feature)

    def set_automatic(self, feature: CameraFeature, *, automatic: bool) -> None:
        self._remote.set_automatic(feature, automatic=automatic)
