"""The service of YARP 4's cameras: all functions, in the order of the service, its server, and the calls of a client.

One row per function, as for control boards. Both ends use the table; the methods are those of
:class:`~rtf.robot.network.served_camera.ServedCamera`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rtf import clock
from rtf.bottle import Bottle, Property
from rtf.errors import RtfError
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.types import Image, call
from rtf.robot.errors import DeviceError, NoAnswerError, NotSupportedError, RefusedError, RobotError
from rtf.robot.interfaces import CameraFeature, IFrameGrabber, IFrameGrabberControls
from rtf.robot.network.served_camera import Configuration, FeatureMode, ServedCamera, image_of
from rtf.robot.yarp4 import functions as row
from rtf.robot.yarp4.functions import refusal, request_of, result_of
from rtf.robot.yarp4.server import DeviceService
from rtf.robot.yarp4.values import (
    BOTTLE,
    NUMBER,
    TEXT,
    TRUTH,
    WHOLE,
    Kind,
    ReturnValue,
    enumeration,
    read_all,
    several,
    single,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.bottle import Value
    from rtf.middleware.ports.network import Network
    from rtf.robot.network.stream_client import RpcConnection
    from rtf.robot.yarp4.functions import Message


def _take_configuration(value: Value) -> Configuration:
    return Configuration(*read_all((WHOLE, WHOLE, NUMBER, WHOLE), BOTTLE.take([value])))


def _take_corner(value: Value) -> tuple[int, int]:
    x, y = read_all((WHOLE, WHOLE), BOTTLE.take([value]))
    return x, y


# Values ---------------------------------------------------------------------------------------------------------------

IMAGE = single(
    "yarp::sig::FlexImage",
    lambda value: image_of(Bottle.adopt([value])),
    lambda image: image,
    Image(np.zeros((0, 0, 3), np.uint8), "rgb"),
)
PROPERTY = single(
    "yarp::os::Property", lambda value: Property.from_bottle(BOTTLE.take([value])), lambda found: found, Property()
)
CONFIGURATIONS = several(single("yarp::dev::CameraConfig", _take_configuration, tuple, ()))
CORNERS = several(single("yarp::dev::vertex_t", _take_corner, tuple, ()))
CROP: Kind = single("yarp::dev::cropType_id_t", lambda value: WHOLE.take([value]), int, 0)
FEATURE = enumeration("std::int32_t", CameraFeature, CameraFeature.BRIGHTNESS)
MODE = enumeration("yarp::dev::FeatureMode", FeatureMode, FeatureMode.UNKNOWN)

# The service ----------------------------------------------------------------------------------------------------------


def _about_feature(name: str, method: str, kind: Kind = TRUTH) -> Message:
    return row.call(name, IFrameGrabberControls, method, takes=(FEATURE,), gives=(kind,))


MESSAGES: tuple[Message, ...] = (
    row.call("getHeightRPC", IFrameGrabber, "height", gives=(WHOLE,)),
    row.call("getWidthRPC", IFrameGrabber, "width", gives=(WHOLE,)),
    row.call("getImageRPC", IFrameGrabber, "colour_image", gives=(IMAGE,)),
    row.call("getImageCropRPC", IFrameGrabber, "cropped_image", takes=(CROP, CORNERS), gives=(IMAGE,)),
    row.call("getRgbWidthRPC", IFrameGrabber, "width", gives=(WHOLE,)),
    row.call("getRgbHeightRPC", IFrameGrabber, "height", gives=(WHOLE,)),
    row.call("getRgbSupportedConfigurationsRPC", IFrameGrabber, "configurations", gives=(CONFIGURATIONS,)),
    row.call("getRgbResolutionRPC", IFrameGrabber, "resolution", gives=(WHOLE, WHOLE)),
    row.call("setRgbResolutionRPC", IFrameGrabber, "set_resolution", takes=(WHOLE, WHOLE)),
    row.call("getRgbFOVRPC", IFrameGrabber, "field_of_view", gives=(NUMBER, NUMBER)),
    row.call("setRgbFOVRPC", IFrameGrabber, "set_field_of_view", takes=(NUMBER, NUMBER)),
    row.call("getRgbIntrinsicParamRPC", IFrameGrabber, "intrinsic_parameters", gives=(PROPERTY,)),
    row.call("getRgbMirroringRPC", IFrameGrabber, "mirrored", gives=(TRUTH,)),
    row.call("setRgbMirroringRPC", IFrameGrabber, "set_mirrored", takes=(TRUTH,)),
    row.call("getCameraDescriptionRPC", IFrameGrabberControls, "camera_description", gives=(WHOLE, TEXT)),
    _about_feature("hasFeatureRPC", "has_feature"),
    row.call("setFeature1RPC", IFrameGrabberControls, "set_feature", takes=(FEATURE, NUMBER)),
    _about_feature("getFeature1RPC", "feature", NUMBER),
    row.call("setFeature2RPC", IFrameGrabberControls, "set_feature", takes=(FEATURE, NUMBER, NUMBER)),
    row.call("getFeature2RPC", IFrameGrabberControls, "feature_pair", takes=(FEATURE,), gives=(NUMBER, NUMBER)),
    _about_feature("hasOnOffRPC", "has_switch"),
    row.call("setActiveRPC", IFrameGrabberControls, "set_active", takes=(FEATURE, TRUTH)),
    _about_feature("getActiveRPC", "is_active"),
    _about_feature("hasAutoRPC", "has_automatic"),
    _about_feature("hasManualRPC", "has_feature"),
    _about_feature("hasOnePushRPC", "has_one_push"),
    row.call("setModeRPC", IFrameGrabberControls, "set_mode", takes=(FEATURE, MODE)),
    _about_feature("getModeRPC", "mode", MODE),
    row.call("setOnePushRPC", IFrameGrabberControls, "push_once", takes=(FEATURE,)),
    row.absent("getVideoModeMaskDC1394RPC", gives=(WHOLE,)),
    row.absent("getVideoModeDC1394RPC", gives=(WHOLE,)),
    row.absent("setVideoModeDC1394RPC", takes=(WHOLE,)),
    row.absent("getFPSMaskDC1394RPC", gives=(WHOLE,)),
    row.absent("getFPSDC1394RPC", gives=(WHOLE,)),
    row.absent("setFPSDC1394RPC", takes=(WHOLE,)),
    row.absent("getISOSpeedDC1394RPC", gives=(WHOLE,)),
    row.absent("setISOSpeedDC1394RPC", takes=(WHOLE,)),
    row.absent("getColorCodingMaskDC1394RPC", takes=(WHOLE,), gives=(WHOLE,)),
    row.absent("getColorCodingDC1394RPC", gives=(WHOLE,)),
    row.absent("setColorCodingDC1394RPC", takes=(WHOLE,)),
    row.absent("getFormat7MaxWindowDC1394RPC", gives=(WHOLE,) * 6),
    row.absent("getFormat7WindowDC1394RPC", gives=(WHOLE,) * 4),
    row.absent("setFormat7WindowDC1394RPC", takes=(WHOLE,) * 4),
    row.absent("setOperationModeDC1394RPC", takes=(TRUTH,)),
    row.absent("getOperationModeDC1394RPC", gives=(TRUTH,)),
    row.absent("setTransmissionDC1394RPC", takes=(TRUTH,)),
    row.absent("getTransmissionDC1394RPC", gives=(TRUTH,)),
    row.absent("setBroadcastDC1394RPC", takes=(TRUTH,)),
    row.absent("setDefaultsDC1394RPC"),
    row.absent("setResetDC1394RPC"),
    row.absent("setPowerDC1394RPC", takes=(TRUTH,)),
    row.absent("setCaptureDC1394RPC", takes=(TRUTH,)),
    row.absent("getBytesPerPacketDC1394RPC", gives=(WHOLE,)),
    row.absent("setBytesPerPacketDC1394RPC", takes=(WHOLE,)),
)

#: The functions by their names.
BY_NAME: Mapping[str, Message] = {message.name: message for message in MESSAGES}


def prototype(message: Message) -> str:
    """Return the prototype of a function, which tools show; its results are named instead of their structure."""
    results = ", ".join(("yarp::dev::ReturnValue", *(kind.cpp for kind in message.gives)))
    return f"{results} FrameGrabberMsgs::{message.name}({', '.join(f'const {kind.cpp}' for kind in message.takes)})"


# The server -----------------------------------------------------------------------------------------------------------


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


# The client -----------------------------------------------------------------------------------------------------------


def has_functions(server: str, network: Network, *, patience: float, function: str = "getWidthRPC") -> bool:
    """Return whether the RPC port of a camera has the functions of YARP 4, by calling one without arguments.

    Cameras of YARP 3 answer it with ``[nak]``; both versions have the same port. ``patience`` is the timeout in seconds
    of real time. Raises DeviceError if there is no server, or it does not answer: one of YARP 4 gives an empty reply
    until its camera is attached.
    """
    try:
        with RpcClient("", server, network=network) as port:
            answer = port.call(call(function), timeout=patience)
    except RtfError as error:
        raise DeviceError(f"{server} cannot be asked: {error}; is its robot running?") from error
    if not answer:
        raise DeviceError(f"{server} gives no answer; is its camera attached?")
    return isinstance(answer.get(0), Bottle)  # the return value is a list of one word


class CameraFunctions(IFrameGrabber, IFrameGrabberControls):
    """A camera at the other end of a connection; every method is a request. ``name`` is for messages."""

    def __init__(self, rpc: RpcConnection, name: str) -> None:
        self._rpc = rpc
        self._name = name

    # The image -------------------------------------------------------------------------------------------------------

    def width(self) -> int:
        return int(self._call("getWidthRPC"))

    def height(self) -> int:
        return int(self._call("getHeightRPC"))

    def image(self) -> tuple[Image, float]:
        asked = clock.current().now()
        return self._call("getImageRPC"), asked

    def field_of_view(self) -> tuple[float, float]:
        horizontal, vertical = self._call("getRgbFOVRPC")
        return horizontal, vertical

    # Controls --------------------------------------------------------------------------------------------------------

    def camera_description(self) -> tuple[int, str]:
        bus, text = self._call("getCameraDescriptionRPC")
        return bus, text

    def has_feature(self, feature: CameraFeature) -> bool:
        return bool(self._call("hasFeatureRPC", feature))

    def feature(self, feature: CameraFeature) -> tuple[float, ...]:
        if feature is CameraFeature.WHITE_BALANCE:
            return tuple(self._call("getFeature2RPC", feature))
        return (self._call("getFeature1RPC", feature),)

    def set_feature(self, feature: CameraFeature, *values: float) -> None:
        if len(values) not in (1, 2):
            raise RefusedError(f"{self._name}: {feature.name} has one value or two, not {len(values)}")
        self._call(f"setFeature{len(values)}RPC", feature, *values)

    def is_active(self, feature: CameraFeature) -> bool:
        return bool(self._call("getActiveRPC", feature))

    def set_active(self, feature: CameraFeature, *, active: bool) -> None:
        self._call("setActiveRPC", feature, active)

    def is_automatic(self, feature: CameraFeature) -> bool:
        return self._call("getModeRPC", feature) is FeatureMode.AUTOMATIC

    def set_automatic(self, feature: CameraFeature, *, automatic: bool) -> None:
        self._call("setModeRPC", feature, FeatureMode.AUTOMATIC if automatic else FeatureMode.MANUAL)

    # Requests --------------------------------------------------------------------------------------------------------

    def _call(self, name: str, *arguments: object) -> Any:
        message = BY_NAME[name]
        answer = self._rpc.ask(request_of(message, arguments))
        return result_of(message, arguments, answer.elements(), device=self._name, error_of=self._error)

    def _error(self, code: ReturnValue, what: str) -> RobotError:
        """Return the error of a code. Cameras report a missing interface as not ready."""
        if code in (ReturnValue.NOT_IMPLEMENTED, ReturnValue.NOT_READY):
            return NotSupportedError(f"{self._name} does not have {what}")
        if code is ReturnValue.COMMUNICATION:
            return NoAnswerError(f"{self._name} has no connection to the camera of {what}")
        return refusal(self._name, code, what)
