"""The service of a YARP 4.0 camera."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.camera_messages import MESSAGES, prototype
from rtf.robot.interfaces import IFrameGrabber, IFrameGrabberControls
from rtf.robot.return_value import ReturnValue
from rtf.robot.server.device_service import DeviceService
from rtf.robot.server.served_camera import ServedCamera

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network
    from rtf.robot.service_rows import Message


class CameraService(DeviceService):
    """The functions of a camera, independent of the port. The arguments are those of :class:`ServedCamera`."""

    def __init__(
        self,
        camera: IFrameGrabber,
        controls: IFrameGrabberControls | None,
        period: float,
        name: str,
        *,
        network: Network,
    ) -> None:
        served = ServedCamera(camera, controls, period)
        known = {IFrameGrabber} if controls is None else {IFrameGrabber, IFrameGrabberControls}

        def target(message: Message) -> object | None:
            return served if message.interface in known else None

        super().__init__(
            MESSAGES,
            target,
            name,
            prototype=prototype,
            missing=ReturnValue.NOT_READY,  # as YARP's cameras answer
            network=network,
        )
