"""The request vocabulary of cameras, and the answers.

The first word names the part of a camera: ``fgi`` its colour image, ``fgir`` its raw image, ``visr`` its optics,
``fgc`` its controls, ``fgfw`` the features of FireWire cameras. A request for something that the camera lacks is
answered ``[fail]``; one for an unknown part ``[nak]``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, BottleError, Vocab, as_float, as_int, as_vocab
from rtf.middleware.types import FAIL, Record
from rtf.robot.camera_messages import FeatureMode
from rtf.robot.errors import NotSupportedError, RefusedError
from rtf.robot.interfaces import CameraFeature, IFrameGrabber, IFrameGrabberControls
from rtf.robot.server.served_camera import RECTANGLE, ServedCamera, cropped

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.middleware.types import Image

COLOUR, RAW, OPTICS, CONTROLS, FIREWIRE = (Vocab(word) for word in ("fgi", "fgir", "visr", "fgc", "fgfw"))
#: The word for the image itself, of either kind.
PICTURE = Vocab("imgr")
GET, SET, HAS, IS, FEATURE = (Vocab(word) for word in ("get", "set", "has", "is", "feat"))
NAK = Bottle([Vocab("nak")])
_CORNERS = 4  # numbers of a rectangle
#: The codes of a rectangle in a crop request; some programs send the number of its corners, 2, instead of 0.
_RECTANGLES = (RECTANGLE, 2)
_WORDS_OF_CROP = 5
_FIREWIRE = frozenset(f"DR2{letter}" for letter in "abcdefghijklmnopqrstuvwxyzABCDEFIJKLMNO")


class CameraResponder:
    """Answers requests to a camera. ``controls`` is None if it has none; ``period`` is the image period in s.

    ``answer`` may raise RobotError and BottleError, which both mean the answer ``[fail]``.
    """

    def __init__(self, camera: IFrameGrabber, controls: IFrameGrabberControls | None, period: float) -> None:
        self._camera = ServedCamera(camera, controls, period)
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
        if word == PICTURE:
            return Record(part, word, IS, self._picture(part))
        if word.text == "crop" and len(request) == _WORDS_OF_CROP and as_int(request[3]) in _RECTANGLES:
            return Record(part, word, IS, _part_of(self._picture(part), request[4]))
        return FAIL

    def _picture(self, part: Vocab) -> Image:
        return self._camera.colour_image() if part == COLOUR else self._camera.raw_image()

    # Optics ----------------------------------------------------------------------------------------------------------

    def _optics(self, request: Bottle) -> Bottle:
        verb, word = as_vocab(request.get(1)), as_vocab(request.get(2))
        if verb == SET:
            return Bottle([OPTICS, SET, int(self._set_optics(word.text, request))])
        if verb != GET:
            return FAIL
        return Bottle([OPTICS, word, IS, *self._get_optics(word.text)])

    def _get_optics(self, word: str) -> Sequence[object]:
        if word in ("w", "h"):
            return (self._camera.width() if word == "w" else self._camera.height(),)
        if word == "res":
            return self._camera.resolution()
        if word == "fov":
            return self._camera.field_of_view()
        if word == "conf":
            known = self._camera.configurations()
            return (len(known), *(value for one in known for value in (*one[:3], Vocab(one.pixels))))
        if word == "intp":
            return (self._camera.intrinsic_parameters("retificationMatrix").to_bottle(),)  # the protocol's spelling
        if word == "mirr":
            return (int(self._camera.mirrored()),)
        raise RefusedError(f"a camera's optics have no {word!r}")

    def _set_optics(self, word: str, request: Bottle) -> bool:
        """Set a value of the optics. Return whether it was set: with these interfaces only the mirror can be."""
        if word not in ("res", "fov", "mirr"):
            raise RefusedError(f"of a camera's optics {word!r} cannot be set")
        try:
            if word == "mirr":
                self._camera.set_mirrored(as_float(request.get(3)))
        except NotSupportedError:
            return False
        return word == "mirr"

    # Controls --------------------------------------------------------------------------------------------------------

    def _control(self, request: Bottle) -> Bottle:
        camera, controls = self._camera, self._camera.controls
        verb, word = as_vocab(request.get(1)), as_vocab(request.get(2))
        if verb == GET and word.text == "camd":
            return Bottle([CONTROLS, word, IS, *controls.camera_description()])
        feature = _feature(request)
        if verb == HAS:
            return Bottle([CONTROLS, HAS, FEATURE, word.value, int(_has(camera, word.text, feature))])
        if verb == GET:
            return Bottle([CONTROLS, word, IS, *_get(camera, word.text, feature)])
        if verb == SET:
            return Bottle([CONTROLS, SET, int(_set(camera, word.text, feature, request[4:]))])
        return FAIL


def _feature(request: Bottle) -> CameraFeature:
    try:
        return CameraFeature(as_int(request[3]))
    except (ValueError, IndexError):
        raise RefusedError(f"{request.to_text()[:60]!r} names no feature; they go from 0 to 22") from None


def _has(camera: ServedCamera, word: str, feature: CameraFeature) -> bool:
    """Return whether a feature exists, and can be switched, set by the camera, by hand, or once by the camera."""
    asked = {
        "feat": camera.has_feature,
        "onof": camera.has_switch,
        "auto": camera.has_automatic,
        "man": camera.has_feature,
        "onep": camera.has_one_push,
    }.get(word)
    if asked is None:
        raise RefusedError(f"a feature has no {word!r}")
    return asked(feature)


def _get(camera: ServedCamera, word: str, feature: CameraFeature) -> Sequence[object]:
    if word == "feat":
        return (camera.feature(feature),)
    if word == "fea2":
        return camera.feature_pair(feature)
    if word == "actv":
        return (int(camera.is_active(feature)),)
    if word == "mode":
        return (int(camera.mode(feature)),)
    raise RefusedError(f"a feature has no {word!r}")


def _set(camera: ServedCamera, word: str, feature: CameraFeature, values: Bottle) -> bool:
    """Set a feature. Return False if the camera refuses."""
    numbers = [as_float(value) for value in values]
    needed = {"feat": 1, "fea2": 2, "actv": 1, "mode": 1, "onep": 0}.get(word)
    if needed is None or len(numbers) != needed or not all(map(math.isfinite, numbers)):
        raise RefusedError(f"invalid values for {word!r} of a feature")
    try:
        if word in ("feat", "fea2"):
            camera.set_feature(feature, *numbers)
        elif word == "actv":
            camera.set_active(feature, numbers[0] != 0)
        elif word == "mode" and numbers[0] in [*FeatureMode]:
            camera.set_mode(feature, FeatureMode(int(numbers[0])))
        else:
            return False
    except (RefusedError, NotSupportedError):
        return False
    return True


def _firewire(request: Bottle) -> Bottle:
    """Answer a FireWire request: 0, because a camera with this interface is not on FireWire."""
    words = {as_vocab(value).text for value in request[1:3]}
    return Bottle([0]) if words & _FIREWIRE else FAIL


def _part_of(image: Image, corners: object) -> Image:
    """Return the part of an image between two corners, inclusive. Raises RefusedError, and BottleError."""
    if not isinstance(corners, Bottle) or len(corners) != _CORNERS:
        raise BottleError("a rectangle is given by two corners, (x0 y0 x1 y1)")
    x0, y0, x1, y1 = map(as_int, corners)
    return cropped(image, ((x0, y0), (x1, y1)))
