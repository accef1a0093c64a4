"""The camera server: a stream of images, and answers to requests."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Dialect, as_string
from rtf.middleware.types import IMAGE, Image
from rtf.robot import parameters
from rtf.robot.errors import NotSupportedError
from rtf.robot.interfaces import IFrameGrabber, IFrameGrabberControls
from rtf.robot.server.camera_service import CameraService
from rtf.robot.server.camera_vocabulary import CameraResponder
from rtf.robot.server.publishing_device import PublishingDevice
from rtf.robot.server.stream_server import StreamServer

if TYPE_CHECKING:
    from rtf.bottle import Property
    from rtf.middleware.ports.network import Network
    from rtf.robot.device import Device
    from rtf.robot.server.outlets import Outlets

_CAPABILITIES = ("COLOR", "RAW")


class FrameGrabberServer(StreamServer[Image]):
    """Publishes the images of a camera at ``NAME``, stamped with their time; the RPC port is ``NAME/rpc``.

    An image is taken only while there are readers, and sent once. ``raw`` sends it unchanged; otherwise it is converted
    to ``rgb``. ``controls`` are the settings of the camera, None if it has none. ``service``: the RPC port has the
    functions of YARP 4 instead of the words of YARP 3; None: by the dialect of the network. Raises ConnectError and
    AddressError.
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
        service: bool | None = None,
    ) -> None:
        super().__init__(name, network=network, period=period, strict=strict, outlets=outlets)
        self._device = device
        self._raw = raw
        self._taken: float | None = None
        if controls is None and isinstance(device, IFrameGrabberControls):
            controls = device
        if service is None:
            service = network.dialect is Dialect.YARP4
        if service:
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
        )
