"""The service of YARP 4.0's cameras: all functions, in the order of the service.

One row per function, as for control boards. Both ends use the table; the methods are those of
:class:`~rtf.robot.server.served_camera.ServedCamera`.
"""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.bottle import BottleError, Dialect, Property
from rtf.bottle.binary import encode
from rtf.middleware.types import Image
from rtf.robot import service_rows as row
from rtf.robot.interfaces import CameraFeature, IFrameGrabber, IFrameGrabberControls
from rtf.robot.service_kinds import BOTTLE, NUMBER, TEXT, TRUTH, WHOLE, Kind, enumeration, read_all, several, single

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.bottle import Value
    from rtf.robot.service_rows import Message


class FeatureMode(IntEnum):
    """The setting of a feature: by the user, or by the camera."""

    UNKNOWN = 0
    MANUAL = 1
    AUTOMATIC = 2


class Configuration(NamedTuple):
    """A size of images, their rate in images a second, and the number of the word for the pixel format."""

    width: int
    height: int
    rate: float
    pixels: int


def _take_image(value: Value) -> Image:
    try:
        return Image.codec.decode(encode(BOTTLE.take([value])), Dialect.YARP4)
    except ValueError as error:
        raise BottleError(f"an image was expected: {error}") from error


def _take_configuration(value: Value) -> Configuration:
    return Configuration(*read_all((WHOLE, WHOLE, NUMBER, WHOLE), BOTTLE.take([value])))


def _take_corner(value: Value) -> tuple[int, int]:
    x, y = read_all((WHOLE, WHOLE), BOTTLE.take([value]))
    return x, y


# Values ---------------------------------------------------------------------------------------------------------------

IMAGE = single("yarp::sig::FlexImage", _take_image, lambda image: image, Image(np.zeros((0, 0, 3), np.uint8), "rgb"))
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
