"""Requests to a camera of YARP 3, which are words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle import Bottle, BottleError, Vocab
from rtf.robot.camera_messages import IMAGE, FeatureMode
from rtf.robot.errors import NoAnswerError, RefusedError
from rtf.robot.interfaces import CameraFeature, IFrameGrabber, IFrameGrabberControls
from rtf.robot.server.camera_vocabulary import COLOUR, CONTROLS, FEATURE, GET, HAS, IS, OPTICS, PICTURE, SET
from rtf.robot.service_kinds import read_all

if TYPE_CHECKING:
    from rtf.middleware.types import Image
    from rtf.robot.client.rpc_connection import RpcConnection

_REFUSALS = (Vocab("fail"), Vocab("nak"))
#: The index of the first value in an answer, after the part of the camera, the word, and "is".
_VALUES = 3


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
            (image,) = read_all((IMAGE,), values)
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
