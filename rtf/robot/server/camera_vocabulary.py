"""The request vocabulary of cameras, and the answers.

The first word names the part of a camera: ``fgi`` its colour image, ``fgir`` its raw image, ``visr`` its optics,
``fgc`` its controls, ``fgfw`` the features of FireWire cameras. A request for something that the camera lacks is
answered ``[fail]``; one for an unknown part ``[nak]``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, BottleError, Property, Vocab, as_float, as_int, as_vocab
from rtf.middleware.types import FAIL, Image, Record
from rtf.robot.errors import NotSupportedError, RefusedError
from rtf.robot.interfaces import CameraFeature, IFrameGrabber, IFrameGrabberControls

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

COLOUR, RAW, OPTICS, CONTROLS, FIREWIRE = (Vocab(word) for word in ("fgi", "fgir", "visr", "fgc", "fgfw"))
GET, SET, HAS, IS, FEATURE = (Vocab(word) for word in ("get", "set", "has", "is", "feat"))
#: The setting of a feature: by the user, or by the camera.
MANUAL, AUTOMATIC = 1, 2
NAK = Bottle([Vocab("nak")])
_CORNERS = 4  # numbers of a rectangle
#: The codes of a rectangle in a crop request; some programs send the number of its corners, 2, instead of 0.
_RECTANGLE = (0, 2)
_WORDS_OF_CROP = 5
_FIREWIRE = frozenset(f"DR2{letter}" for letter in "abcdefghijklmnopqrstuvwxyzABCDEFIJKLMNO")


class CameraResponder:
    """Answers requests to a camera. ``controls`` is None if it has none; ``period`` is the image period in s.

    ``answer`` may raise RobotError and BottleError, which both mean the answer ``[fail]``.
    """

    def __init__(self, camera: IFrameGrabber, controls: IFrameGrabberControls | None, period: float) -> None:
        self._camera = camera
        self._controls = controls
        self._period = period
        self._parts: dict[Vocab, Callable[[Bottle], object]] = {
            COLOUR: self._image,
            RAW: self._image,
            OPTICS: self._optics,
            CONTROLS: self._control,
            FIREWIRE: _firewire,
        }

    def answer(self, request: Bottle) -> object:
        """Return the answer to a request."""
        part = self._parts.get(as_vocab(request.get(0)))
        return NAK if part is None else part(request)

    # Images ----------------------------------------------------------------------------------------------------------

    def _image(self, request: Bottle) -> object:
        part, verb, word = (as_vocab(request.get(place)) for place in range(3))
        if verb != GET:
            return FAIL
        if word.text == "w":
            return Bottle([part, word, IS, self._camera.width()])
        if word.text == "h":
            return Bottle([part, word, IS, self._camera.height()])
        if word == part:
            return Record(part, word, IS, self._picture(part))
        if word.text == "crop" and len(request) == _WORDS_OF_CROP and as_int(request[3]) in _RECTANGLE:
            return Record(part, word, IS, _cropped(self._picture(part), request[4]))
        return FAIL

    def _picture(self, part: Vocab) -> Image:
        image, _ = self._camera.image()
        if part == COLOUR:
            return image.to("rgb")
        if image.format.channels != 1:
            raise NotSupportedError("the camera gives colours only; ask for fgi")
        return image

    # Optics ----------------------------------------------------------------------------------------------------------

    def _optics(self, request: Bottle) -> Bottle:
        verb, word = as_vocab(request.get(1)), as_vocab(request.get(2))
        if verb == SET:
            return Bottle([OPTICS, SET, int(self._set_optics(word.text, request))])
        if verb != GET:
            return FAIL
        return Bottle([OPTICS, word, IS, *self._get_optics(word.text)])

    def _get_optics(self, word: str) -> Sequence[object]:
        width, height = self._camera.width(), self._camera.height()
        if word in ("w", "h"):
            return (width if word == "w" else height,)
        if word == "res":
            return (width, height)
        if word == "fov":
            return tuple(map(float, self._camera.field_of_view()))
        if word == "conf":
            return (1, width, height, 1.0 / self._period, Vocab("rgb"))
        if word == "intp":
            return (pinhole(width, height, *self._camera.field_of_view()).to_bottle(),)
        if word == "mirr":
            return (int(self._mirrors() and self._with_controls().feature(CameraFeature.MIRROR)[0] != 0),)
        raise RefusedError(f"a camera's optics have no {word!r}")

    def _set_optics(self, word: str, request: Bottle) -> bool:
        """Set a value of the optics. Return whether it was set: with these interfaces only the mirror can be."""
        if word not in ("res", "fov", "mirr"):
            raise RefusedError(f"of a camera's optics {word!r} cannot be set")
        if word != "mirr" or not self._mirrors():
            return False
        self._with_controls().set_feature(CameraFeature.MIRROR, as_float(request.get(3)))
        return True

    def _mirrors(self) -> bool:
        return self._controls is not None and self._controls.has_feature(CameraFeature.MIRROR)

    # Controls --------------------------------------------------------------------------------------------------------

    def _with_controls(self) -> IFrameGrabberControls:
        if self._controls is None:
            raise NotSupportedError("the camera has no controls")
        return self._controls

    def _control(self, request: Bottle) -> Bottle:
        controls = self._with_controls()
        verb, word = as_vocab(request.get(1)), as_vocab(request.get(2))
        if verb == GET and word.text == "camd":
            return Bottle([CONTROLS, word, IS, *controls.camera_description()])
        feature = _feature(request)
        if verb == HAS:
            return Bottle([CONTROLS, HAS, FEATURE, word.value, int(_has(controls, word.text, feature))])
        if verb == GET:
            return Bottle([CONTROLS, word, IS, *_get(controls, word.text, feature)])
        if verb == SET:
            return Bottle([CONTROLS, SET, int(_set(controls, word.text, feature, request[4:]))])
        return FAIL


def _feature(request: Bottle) -> CameraFeature:
    try:
        return CameraFeature(as_int(request[3]))
    except (ValueError, IndexError):
        raise RefusedError(f"{request.to_text()[:60]!r} names no feature; they go from 0 to 22") from None


def _has(controls: IFrameGrabberControls, word: str, feature: CameraFeature) -> bool:
    """Return whether a feature exists, and can be switched, set by the camera, by hand, or once by the camera."""
    if word not in ("feat", "onof", "auto", "man", "onep"):
        raise RefusedError(f"a feature has no {word!r}")
    if word == "onep" or not controls.has_feature(feature):
        return False
    try:
        if word == "onof":
            controls.is_active(feature)
        elif word == "auto":
            controls.is_automatic(feature)
    except NotSupportedError:
        return False
    return True


def _get(controls: IFrameGrabberControls, word: str, feature: CameraFeature) -> Sequence[object]:
    if word in ("feat", "fea2"):
        values = controls.feature(feature)
        if len(values) != (1 if word == "feat" else 2):
            raise RefusedError(f"{feature.name} has {len(values)} values")
        return tuple(map(float, values))
    if word == "actv":
        return (int(controls.is_active(feature)),)
    if word == "mode":
        return (AUTOMATIC if controls.is_automatic(feature) else MANUAL,)
    raise RefusedError(f"a feature has no {word!r}")


def _set(controls: IFrameGrabberControls, word: str, feature: CameraFeature, values: Bottle) -> bool:
    """Set a feature. Return False if the camera refuses."""
    numbers = [as_float(value) for value in values]
    needed = {"feat": 1, "fea2": 2, "actv": 1, "mode": 1, "onep": 0}.get(word)
    if needed is None or len(numbers) != needed or not all(map(math.isfinite, numbers)):
        raise RefusedError(f"invalid values for {word!r} of a feature")
    try:
        if word in ("feat", "fea2"):
            controls.set_feature(feature, *numbers)
        elif word == "actv":
            controls.set_active(feature, active=numbers[0] != 0)
        elif word == "mode" and numbers[0] in (MANUAL, AUTOMATIC):
            controls.set_automatic(feature, automatic=numbers[0] == AUTOMATIC)
        else:
            return False
    except (RefusedError, NotSupportedError):
        return False
    return True


def _firewire(request: Bottle) -> Bottle:
    """Answer a FireWire request: 0, because a camera with this interface is not on FireWire."""
    words = {as_vocab(value).text for value in request[1:3]}
    return Bottle([0]) if words & _FIREWIRE else FAIL


def _cropped(image: Image, corners: object) -> Image:
    """Return the part of an image between two corners, inclusive. Raises RefusedError, and BottleError."""
    if not isinstance(corners, Bottle) or len(corners) != _CORNERS:
        raise BottleError("a rectangle is given by two corners, (x0 y0 x1 y1)")
    x0, y0, x1, y1 = map(as_int, corners)
    left, right, top, bottom = min(x0, x1), max(x0, x1), min(y0, y1), max(y0, y1)
    if not (left >= 0 and right < image.width and top >= 0 and bottom < image.height):
        raise RefusedError(f"({x0} {y0} {x1} {y1}) is not inside of {image.width} x {image.height} pixels")
    return Image(image.pixels[top : bottom + 1, left : right + 1], image.format, image.quantum)


def pinhole(width: int, height: int, horizontal: float, vertical: float) -> Property:
    """Return the intrinsic parameters of a camera without distortion. Fields of view in deg, lengths in pixels."""
    return Property(
        {
            "physFocalLength": 0.0,
            "focalLengthX": width / 2 / math.tan(math.radians(horizontal) / 2),
            "focalLengthY": height / 2 / math.tan(math.radians(vertical) / 2),
            "principalPointX": (width - 1) / 2,
            "principalPointY": (height - 1) / 2,
            "retificationMatrix": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],  # the protocol's spelling
            "distortionModel": "none",
            **dict.fromkeys(("k1", "k2", "k3", "t1", "t2"), 0.0),
        }
    )
