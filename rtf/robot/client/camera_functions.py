"""Requests to a camera of YARP 4, which are functions of a service."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rtf import clock
from rtf.bottle import Bottle
from rtf.errors import RtfError
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.types import call
from rtf.robot.camera_messages import BY_NAME, FeatureMode
from rtf.robot.client.function_call import refusal, request_of, result_of
from rtf.robot.errors import DeviceError, NoAnswerError, NotSupportedError, RefusedError, RobotError
from rtf.robot.interfaces import CameraFeature, IFrameGrabber, IFrameGrabberControls
from rtf.robot.return_value import ReturnValue

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network
    from rtf.middleware.types import Image
    from rtf.robot.client.rpc_connection import RpcConnection


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
        return refusal(self._name, what, code)
