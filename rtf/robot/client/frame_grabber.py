"""The client of a camera server of YARP 3 or YARP 4."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

from rtf.bottle import Dialect
from rtf.middleware.types import IMAGE, Image
from rtf.robot import parameters
from rtf.robot.client.camera_functions import CameraFunctions, has_functions
from rtf.robot.client.camera_words import CameraWords
from rtf.robot.client.latest_message import LatestMessage
from rtf.robot.client.rpc_connection import RpcConnection
from rtf.robot.client.settings import RPC_TIMEOUT, unique_local
from rtf.robot.device import Device
from rtf.robot.errors import DeviceError, NoAnswerError
from rtf.robot.interfaces import CameraFeature, IFrameGrabber, IFrameGrabberControls

if TYPE_CHECKING:
    from rtf.bottle import Property

#: Default age after which an image is stale, in seconds: the slowest cameras give one image a second.
TIMEOUT = 2.0
_MAX_SIDE = 1 << 16


class FrameGrabberClient(Device, IFrameGrabber, IFrameGrabberControls):
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

    _stream: LatestMessage[Image] | None = None
    _requests: CameraWords | CameraFunctions | None = None
    _opened: ExitStack | None = None

    def open(self, configuration: Property) -> None:
        """See Device. The server must be there."""
        source = parameters.port_name(configuration, "remote")
        local = parameters.port_name(configuration, "local", unique_local(source))
        timeout = parameters.positive(configuration, "timeout", TIMEOUT)
        carrier = parameters.carrier(configuration, "fast_tcp")
        asked = parameters.flag(configuration, "no_stream")
        server = f"{source}/rpc"
        functions = has_functions(server, self.network, patience=RPC_TIMEOUT)
        network = self.network.in_dialect(Dialect.YARP4) if functions else self.network
        with ExitStack() as opened:
            rpc = RpcConnection(f"{local}/rpc", server, patience=RPC_TIMEOUT, network=network)
            opened.callback(rpc.close)
            stream = None
            if not asked:
                stream = LatestMessage(local, IMAGE, timeout=timeout, network=self.network)
                opened.callback(stream.close)
                stream.connect(source, carrier)
            requests = CameraFunctions(rpc, self.name) if functions else CameraWords(rpc, self.name)
            self._stream, self._requests, self._opened = stream, requests, opened.pop_all()

    def close(self) -> None:
        self._stream = self._requests = None
        if self._opened is not None:
            self._opened.close()
            self._opened = None

    @property
    def _remote(self) -> CameraWords | CameraFunctions:
        if self._requests is None:
            raise DeviceError(f"{self.name} is not open")
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
        latest = self._stream.fresh()
        return latest.value, latest.at if latest.stamp is None else latest.stamp.time

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
