"""The request vocabulary of depth cameras of YARP 3, at both ends.

The first word of a request is ``visr`` for the optics of the colour camera, ``visd`` for those of the depth camera, and
``rgdb`` for both together. What cannot be answered is answered ``[fail]``, other words ``[nak]``. The source is YARP
3.12, ``RgbdSensor_nws_yarp`` and ``DepthVisualParams_Responder``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from rtf.bottle import Bottle, BottleError, Property, Vocab, as_vocab
from rtf.middleware.types import FAIL
from rtf.robot.errors import NoAnswerError, RefusedError
from rtf.robot.interfaces import IRgbdOptics, RgbdPart, RgbdStatus
from rtf.robot.network.camera_optics import intrinsics_of, matrix_of, property_of
from rtf.robot.network.elements import inner, number, whole

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from rtf.bottle import Value
    from rtf.robot.interfaces import FloatArray, Intrinsics
    from rtf.robot.network.stream_client import RpcConnection

#: The version of the protocol.
VERSION = (1, 0)
_GET, _SET, _IS, _BOTH = (Vocab(word) for word in ("get", "set", "is", "rgdb"))
_WORDS = {RgbdPart.COLOUR: Vocab("visr"), RgbdPart.DEPTH: Vocab("visd")}
_PARTS = {word: part for part, word in _WORDS.items()}
_NAK = Bottle([Vocab("nak")])
_HEAD = 3  # elements before the values of an answer


class RgbdResponder:
    """Answers requests to a depth camera. ``answer`` may raise RobotError, which means the answer ``[fail]``."""

    #: The values of both cameras, by the word of a request.
    _common: ClassVar[Mapping[str, Callable[[IRgbdOptics, RgbdPart], Sequence[object]]]] = {
        "w": lambda sensor, part: sensor.size(part)[:1],
        "h": lambda sensor, part: sensor.size(part)[1:],
        "res": lambda sensor, part: sensor.size(part),
        "fov": lambda sensor, part: [*map(float, sensor.field_of_view(part))],
        "intp": lambda sensor, part: (property_of(sensor.intrinsics(part)).to_bottle(),),
        "mirr": lambda _sensor, _part: (0,),
    }

    def __init__(self, sensor: IRgbdOptics) -> None:
        self._sensor = sensor

    def answer(self, request: Bottle) -> Bottle:
        """Return the answer to a request."""
        first, verb, word = (as_vocab(request.get(place)) for place in range(3))
        if first != _BOTH and first not in _PARTS:
            return _NAK
        if verb == _SET and first in _PARTS:  # nothing can be set by these interfaces
            return Bottle([first, _SET, 0])
        if verb != _GET:
            return FAIL
        values = self._of_both(word.text) if first == _BOTH else self._of_part(_PARTS[first], word.text)
        return FAIL if values is None else Bottle([first, word, _IS, *values])

    def _of_part(self, part: RgbdPart, word: str) -> Sequence[object] | None:
        sensor = self._sensor
        if part is RgbdPart.DEPTH and word == "acrc":
            return (float(sensor.depth_accuracy()),)
        if part is RgbdPart.DEPTH and word == "clip":
            return [*map(float, sensor.clip_planes())]
        get = self._common.get(word)
        return None if get is None else get(sensor, part)

    def _of_both(self, word: str) -> Sequence[object] | None:
        if word == "prot":
            return VERSION
        if word == "stat":
            return (int(self._sensor.rgbd_status()),)
        if word == "mess":
            return ("no error",)
        if word == "ext":  # the three elements of a matrix, without brackets
            matrix = self._sensor.extrinsics()
            return (*matrix.shape, Bottle(matrix.ravel().tolist()))
        return None


class RgbdWords(IRgbdOptics):
    """A depth camera of YARP 3 at the other end of a connection; every method is a request.

    Raises RefusedError if the server refuses, NoAnswerError for an invalid answer. ``name`` is for messages.
    """

    def __init__(self, rpc: RpcConnection, name: str) -> None:
        self._rpc = rpc
        self._name = name

    def size(self, part: RgbdPart) -> tuple[int, int]:
        (width,), (height,) = (self._ask(_WORDS[part], word, whole) for word in ("w", "h"))
        return width, height

    def field_of_view(self, part: RgbdPart) -> tuple[float, float]:
        horizontal, vertical = self._ask(_WORDS[part], "fov", number, number)
        return horizontal, vertical

    def intrinsics(self, part: RgbdPart) -> Intrinsics:
        answer = self._answer(_WORDS[part], "intp")
        found = answer.get(0)
        try:
            return intrinsics_of(Property.from_bottle(found if isinstance(found, Bottle) else answer))
        except BottleError as error:
            raise NoAnswerError(f"{self._name}: {error}") from error

    def clip_planes(self) -> tuple[float, float]:
        near, far = self._ask(_WORDS[RgbdPart.DEPTH], "clip", number, number)
        return near, far

    def depth_accuracy(self) -> float:
        (accuracy,) = self._ask(_WORDS[RgbdPart.DEPTH], "acrc", number)
        return float(accuracy)

    def extrinsics(self) -> FloatArray:
        return matrix_of(self._answer(_BOTH, "ext"), self._name)

    def rgbd_status(self) -> RgbdStatus:
        (status,) = self._ask(_BOTH, "stat", whole)
        try:
            return RgbdStatus(status)
        except ValueError:
            raise NoAnswerError(f"{self._name}: a depth camera has no status {status}") from None

    def protocol(self) -> tuple[int, int]:
        """Return the version of the server's protocol."""
        major, minor = self._ask(_BOTH, "prot", whole, whole)
        return major, minor

    def _ask(self, first: Vocab, word: str, *kinds: Callable[[Value], Any]) -> list[Any]:
        values = self._answer(first, word)
        try:
            elements = inner(values, len(kinds))
            return [kind(value) for kind, value in zip(kinds, elements, strict=True)]
        except RefusedError as error:
            raise NoAnswerError(
                f"{self._name}: no valid answer to {Bottle([first, _GET, Vocab(word)])}: {error}"
            ) from error

    def _answer(self, first: Vocab, word: str) -> Bottle:
        """Return the values in the answer to a request."""
        request = Bottle([first, _GET, Vocab(word)])
        answer = self._rpc.ask(request)
        if answer.get(0) in (Vocab("fail"), Vocab("nak")):
            raise RefusedError(f"{self._name}: the server answers {request} with {answer.to_text()[:60]}")
        if answer[:_HEAD] != Bottle([first, Vocab(word), _IS]):
            raise NoAnswerError(f"{self._name}: {answer.to_text()[:60]!r} is not an answer to {request}")
        return answer[_HEAD:]
