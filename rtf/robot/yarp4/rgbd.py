"""The service of depth cameras of YARP 4.0, at both ends.

The source is YARP's ``RGBDSensorMsgs.thrift``. Its functions for the features of a camera are those of all cameras.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.bottle import BottleError
from rtf.middleware.types import Image, Stamp
from rtf.robot.errors import NoAnswerError, NotSupportedError
from rtf.robot.interfaces import IFrameGrabberControls, IRgbdOptics, IRgbdSensor, RgbdPart, RgbdStatus
from rtf.robot.network.camera_optics import intrinsics_of, matrix_of, property_of
from rtf.robot.yarp4 import functions as row
from rtf.robot.yarp4.camera import BY_NAME as CAMERA_FUNCTIONS
from rtf.robot.yarp4.camera import CONFIGURATIONS, IMAGE, PROPERTY
from rtf.robot.yarp4.functions import refusal, request_of, result_of
from rtf.robot.yarp4.server import DeviceService
from rtf.robot.yarp4.values import BOTTLE, NUMBER, TEXT, TRUTH, WHOLE, Kind, ReturnValue, enumeration, read_all, single

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from rtf.bottle import Value
    from rtf.middleware.ports.network import Network
    from rtf.robot.interfaces import FloatArray, Intrinsics
    from rtf.robot.network.stream_client import RpcConnection
    from rtf.robot.yarp4.functions import Message


def _take_stamp(value: Value) -> Stamp:
    count, time = read_all((WHOLE, NUMBER), BOTTLE.take([value]))
    return Stamp(count, time)


MATRIX = single("yarp::sig::Matrix", lambda value: BOTTLE.take([value]), lambda matrix: matrix, np.zeros((0, 0)))
STAMP = single("yarp::os::Stamp", _take_stamp, lambda stamp: stamp, Stamp())
DEPTH = Kind("yarp::sig::ImageOf<yarp::sig::PixelFloat>", IMAGE.take, IMAGE.put, Image(np.zeros((0, 0), np.float32)))
STATUS = enumeration("yarp::dev::IRGBDSensor::RGBDSensor_status", RgbdStatus, RgbdStatus.NOT_READY)

# The service ----------------------------------------------------------------------------------------------------------


def _reads(name: str, run: Callable[[Any], object], *gives: Kind) -> Message:
    return row.own(name, IRgbdSensor, run, gives=gives)


def _fixed(name: str, *takes: Kind) -> Message:
    """Return a function that sets what these interfaces cannot set."""

    def refuse(_sensor: object, *_values: object) -> None:
        raise NotSupportedError(f"{name}: it cannot be set")

    return row.own(name, IRgbdSensor, refuse, takes=takes)


def _of_part(prefix: str, part: RgbdPart) -> tuple[Message, ...]:
    return (
        _reads(f"get{prefix}WidthRPC", lambda sensor: sensor.size(part)[0], WHOLE),
        _reads(f"get{prefix}HeightRPC", lambda sensor: sensor.size(part)[1], WHOLE),
        _reads(f"get{prefix}ResolutionRPC", lambda sensor: sensor.size(part), WHOLE, WHOLE),
        _fixed(f"set{prefix}ResolutionRPC", WHOLE, WHOLE),
        _reads(f"get{prefix}FOVRPC", lambda sensor: sensor.field_of_view(part), NUMBER, NUMBER),
        _fixed(f"set{prefix}FOVRPC", NUMBER, NUMBER),
        _reads(f"get{prefix}IntrinsicParamRPC", lambda sensor: property_of(sensor.intrinsics(part)), PROPERTY),
        _reads(f"get{prefix}MirroringRPC", lambda _sensor: False, TRUTH),
        _fixed(f"set{prefix}MirroringRPC", TRUTH),
    )


def _all_images(sensor: IRgbdSensor) -> tuple[object, ...]:
    found = sensor.images()
    return found.colour, found.depth, Stamp(0, found.colour_time), Stamp(0, found.depth_time)


MESSAGES: tuple[Message, ...] = (
    _reads("getExtrinsicParamRPC", lambda sensor: sensor.extrinsics(), MATRIX),
    _reads("getLastErrorMsgRPC", lambda _sensor: ("no error", Stamp()), TEXT, STAMP),
    _reads("getRgbImageRPC", lambda sensor: _all_images(sensor)[0::2], IMAGE, STAMP),
    _reads("getDepthImageRPC", lambda sensor: _all_images(sensor)[1::2], DEPTH, STAMP),
    _reads("getImagesRPC", _all_images, IMAGE, DEPTH, STAMP, STAMP),
    _reads("getSensorStatusRPC", lambda sensor: sensor.rgbd_status(), STATUS),
    *_of_part("Rgb", RgbdPart.COLOUR),
    row.absent("getRgbSupportedConfigurationsRPC", gives=(CONFIGURATIONS,)),
    *_of_part("Depth", RgbdPart.DEPTH),
    _reads("getDepthAccuracyRPC", lambda sensor: float(sensor.depth_accuracy()), NUMBER),
    _fixed("setDepthAccuracyRPC", NUMBER),
    _reads("getDepthClipPlanesRPC", lambda sensor: sensor.clip_planes(), NUMBER, NUMBER),
    _fixed("setDepthClipPlanesRPC", NUMBER, NUMBER),
    *(message for message in CAMERA_FUNCTIONS.values() if message.interface is IFrameGrabberControls),
)
BY_NAME: Mapping[str, Message] = {message.name: message for message in MESSAGES}
_PREFIXES = {RgbdPart.COLOUR: "Rgb", RgbdPart.DEPTH: "Depth"}


def _prototype(message: Message) -> str:
    results = ", ".join(("yarp::dev::ReturnValue", *(kind.cpp for kind in message.gives)))
    return f"{results} RGBDSensorMsgs::{message.name}({', '.join(f'const {kind.cpp}' for kind in message.takes)})"


def rgbd_service(sensor: IRgbdSensor, name: str, *, network: Network) -> DeviceService:
    """Return the functions of a depth camera, independent of the port. It has no features of a camera."""
    return DeviceService(
        MESSAGES,
        lambda message: sensor if message.interface is IRgbdSensor else None,
        name,
        prototype=_prototype,
        missing=ReturnValue.NOT_READY,  # as YARP's depth cameras answer
        network=network,
    )


class RgbdFunctions(IRgbdOptics):
    """A depth camera of YARP 4 at the other end of a connection; every method is a request.

    Raises RefusedError if the server refuses, NoAnswerError for an invalid answer. ``name`` is for messages.
    """

    def __init__(self, rpc: RpcConnection, name: str) -> None:
        self._rpc = rpc
        self._name = name

    def size(self, part: RgbdPart) -> tuple[int, int]:
        return int(self._call(f"get{_PREFIXES[part]}WidthRPC")), int(self._call(f"get{_PREFIXES[part]}HeightRPC"))

    def field_of_view(self, part: RgbdPart) -> tuple[float, float]:
        horizontal, vertical = self._call(f"get{_PREFIXES[part]}FOVRPC")
        return horizontal, vertical

    def intrinsics(self, part: RgbdPart) -> Intrinsics:
        try:
            return intrinsics_of(self._call(f"get{_PREFIXES[part]}IntrinsicParamRPC"))
        except BottleError as error:
            raise NoAnswerError(f"{self._name}: {error}") from error

    def clip_planes(self) -> tuple[float, float]:
        near, far = self._call("getDepthClipPlanesRPC")
        return near, far

    def depth_accuracy(self) -> float:
        return float(self._call("getDepthAccuracyRPC"))

    def extrinsics(self) -> FloatArray:
        return matrix_of(self._call("getExtrinsicParamRPC"), self._name)

    def rgbd_status(self) -> RgbdStatus:
        return RgbdStatus(self._call("getSensorStatusRPC"))

    def _call(self, name: str) -> Any:
        message = BY_NAME[name]
        answer = self._rpc.ask(request_of(message, ()))
        return result_of(message, (), answer.elements(), device=self._name, error_of=partial(refusal, self._name))
