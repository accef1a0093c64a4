"""The request vocabulary of YARP 3's cameras: the answers of a server, and the requests of a client.

The first word names the part of a camera: ``fgi`` its colour image, ``fgir`` its raw image, ``visr`` its optics,
``fgc`` its controls, ``fgfw`` the features of FireWire cameras. A request for something that the camera lacks is
answered ``[fail]``; one for an unknown part ``[nak]``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle import Bottle, BottleError, Vocab, as_float, as_int, as_vocab
from rtf.middleware.types import FAIL, Record
from rtf.robot.errors import NoAnswerError, NotSupportedError, RefusedError
from rtf.robot.interfaces import CameraFeature, IFrameGrabber, IFrameGrabberControls
from rtf.robot.network.served_camera import RECTANGLE, FeatureMode, ServedCamera, cropped, image_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.middleware.types import Image
    from rtf.robot.network.stream_client import RpcConnection

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
_REFUSALS = (Vocab("fail"), Vocab("nak"))
#: The index of the first value in an answer, after the part of the camera, the word, and "is".
_VALUES = 3


# The answers of a server ----------------------------------------------------------------------------------------------


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


# The requests of a client ---------------------------------------------------------------------------------------------


class CameraWords(IFrameGrabber, IFrameGrabberControls):
    """A camera at the other end of a connection; every method is a request. ``name`` is for messages."""

    def __init__(self, rpc: RpcConnection, name: str) -> None:
        self._rpc = rpc
        self._name = name

    # The image -------------------------------------------------------------------------------------------------------

    def width(self) -> int:
        return self._integer(COLOUR, GET, Vocab("w"))

    def height(self) -> int:
        return self._integer(COLOUR, GET, Vocab("h"))

    def image(self) -> tuple[Image, float]:
        asked = clock.current().now()
        values = self._ask(COLOUR, GET, PICTURE)
        try:
            image = image_of(values)
        except BottleError as error:
            raise NoAnswerError(f"{self._name}: the server's answer holds no image: {error}") from error
        return image, asked

    def field_of_view(self) -> tuple[float, float]:
        horizontal, vertical = self._numbers(2, OPTICS, GET, Vocab("fov"))
        return horizontal, vertical

    # Controls --------------------------------------------------------------------------------------------------------

    def camera_description(self) -> tuple[int, str]:
        values = self._ask(CONTROLS, GET, Vocab("camd"))
        if len(values) != 2 or not isinstance(values[0], int) or not isinstance(values[1], str):  # noqa: PLR2004 - bus, text
            raise NoAnswerError(f"{self._name}: invalid description of the camera: {values.to_text()[:60]}")
        return values[0], values[1]

    def has_feature(self, feature: CameraFeature) -> bool:
        return self._integer(CONTROLS, HAS, FEATURE, int(feature)) != 0

    def feature(self, feature: CameraFeature) -> tuple[float, ...]:
        if feature is CameraFeature.WHITE_BALANCE:
            return self._numbers(2, CONTROLS, GET, Vocab("fea2"), int(feature))
        return self._numbers(1, CONTROLS, GET, FEATURE, int(feature))

    def set_feature(self, feature: CameraFeature, *values: float) -> None:
        word = FEATURE if len(values) == 1 else Vocab("fea2")
        self._set(word, int(feature), *map(float, values))

    def is_active(self, feature: CameraFeature) -> bool:
        return self._integer(CONTROLS, GET, Vocab("actv"), int(feature)) != 0

    def set_active(self, feature: CameraFeature, *, active: bool) -> None:
        self._set(Vocab("actv"), int(feature), int(active))

    def is_automatic(self, feature: CameraFeature) -> bool:
        return self._integer(CONTROLS, GET, Vocab("mode"), int(feature)) == FeatureMode.AUTOMATIC

    def set_automatic(self, feature: CameraFeature, *, automatic: bool) -> None:
        self._set(Vocab("mode"), int(feature), int(FeatureMode.AUTOMATIC if automatic else FeatureMode.MANUAL))

    # Requests --------------------------------------------------------------------------------------------------------

    def _set(self, *words: object) -> None:
        answer = self._answer(CONTROLS, SET, *words)
        # YARP's servers answer [fgc] [set] and whether it worked, or nothing at all when it did.
        if len(answer) > 2 and answer[2] == 0:  # noqa: PLR2004 - behind these two words
            raise RefusedError(f"{self._name}: the camera refuses {Bottle(words).to_text()}")

    def _integer(self, *words: object) -> int:
        values = self._ask(*words)
        if not len(values) or not isinstance(values[-1], int):
            raise NoAnswerError(f"{self._name}: {values.to_text()[:60]!r} is not an answer to {Bottle(words)}")
        return int(values[-1])

    def _numbers(self, count: int, *words: object) -> tuple[float, ...]:
        values = self._ask(*words)
        found = tuple(float(value) for value in values if isinstance(value, int | float))
        if len(found) != len(values) or len(found) != count:
            raise NoAnswerError(f"{self._name}: {values.to_text()[:60]!r} is not an answer to {Bottle(words)}")
        return found

    def _ask(self, *words: object) -> Bottle:
        """Return the values in the answer to a ``get`` or ``has`` request."""
        answer = self._answer(*words)
        head = [words[0], HAS, FEATURE] if words[1] == HAS else [words[0], words[2], IS]
        if answer[:_VALUES] != Bottle(head):
            raise NoAnswerError(f"{self._name}: {answer.to_text()[:60]!r} is not an answer to {Bottle(words)}")
        return answer[_VALUES:]

    def _answer(self, *words: object) -> Bottle:
        answer = self._rpc.ask(Bottle(words))
        if answer.get(0) in _REFUSALS:
            raise RefusedError(f"{self._name}: the server answers {Bottle(words)} with {answer.to_text()[:60]}")
        return answer
