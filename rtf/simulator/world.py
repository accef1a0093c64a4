"""The port ``/NAME/world`` of a simulated robot: the ball of its scene, in the words of the iCub_SIM.

===================================== ==================================================================================
``world mk ssph R X Y Z [RED G B]``   make the ball, with a radius (m) and a colour (0 to 1); also ``sph``
``world set ball X Y Z``              move it; also ``world set ssph 1 X Y Z``
``world get ball``                    the reply is ``X Y Z``; also ``world get ssph 1``
``world del all``                     remove it
===================================== ==================================================================================

There is one ball, which is number 1. It does not fall, so ``sph`` and ``ssph`` are the same. Replies are ``[ok]``, or
``[fail]`` and a message. Places are those of the iCub_SIM: x to the left of the robot, y up from the floor, z to the
front, with its origin below the robot (:func:`from_world`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.bottle import Bottle, Vocab, as_float
from rtf.robot.errors import RefusedError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.robot.interfaces import FloatArray, Values
    from rtf.simulator.ball import Ball

#: The suffix of the port.
WORLD = "/world"
_OK, _FAIL = Vocab("ok"), Vocab("fail")
#: The frame of the root in the frame of the iCub_SIM, as its documentation has it.
_TURN = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
_ORIGIN = np.array([0.0, 0.5976, -0.026])
_SPHERES = ("sph", "ssph")
_NUMBER = 1
_HELP = (
    "world mk ssph RADIUS X Y Z [RED GREEN BLUE]",
    "world set ball X Y Z",
    "world get ball",
    "world del all",
)
#: The greatest number of characters of a request that a reply repeats.
_ECHO = 80


def from_world(place: Values) -> FloatArray:
    """Return a place of the iCub_SIM's world in the frame of the robot's root (m)."""
    found: FloatArray = _TURN.T @ (np.asarray(place, dtype=np.float64) - _ORIGIN)
    return found


def to_world(place: Values) -> FloatArray:
    """Return a place in the frame of the robot's root in that of the iCub_SIM's world (m)."""
    found: FloatArray = _TURN @ np.asarray(place, dtype=np.float64) + _ORIGIN
    return found


class World:
    """The requests. ``answer`` may be called in any thread."""

    def __init__(self, ball: Ball) -> None:
        self._ball = ball
        self._requests: dict[str, Callable[[Sequence[object]], Bottle]] = {
            "mk": self._make,
            "set": self._set,
            "get": self._get,
            "del": self._delete,
        }

    def answer(self, request: Bottle) -> object:
        """Return the reply to a request."""
        words = list(request)
        if words[:1] == ["help"]:
            return Bottle([Vocab("many"), *_HELP])
        asked = self._requests.get(str(words[1])) if words[:1] == ["world"] and len(words) > 1 else None
        if asked is None:
            return Bottle([_FAIL, f"{request.to_text()[:_ECHO]!r} is not a request; they are {', '.join(_HELP)}"])
        try:
            return asked(words[2:])
        except RefusedError as error:
            return Bottle([_FAIL, str(error)])

    def _make(self, words: Sequence[object]) -> Bottle:
        if not words or words[0] not in _SPHERES:
            raise RefusedError("mk: this world can have a ball only: mk ssph RADIUS X Y Z [RED GREEN BLUE]")
        values = _numbers(words[1:])
        if len(values) not in (4, 7):
            raise RefusedError(f"mk {words[0]}: write RADIUS X Y Z [RED GREEN BLUE], not {len(values)} numbers")
        if self._ball.there:
            raise RefusedError("mk: there is a ball already; set moves it, and del all removes it")
        self._ball.show(list(from_world(values[1:4])), values[0], values[4:])
        return Bottle([_OK])

    def _set(self, words: Sequence[object]) -> Bottle:
        place = _numbers(self._of_ball("set", words))
        if len(place) != 3:  # noqa: PLR2004 - x, y and z
            raise RefusedError(f"set: write X Y Z after the ball, not {len(place)} numbers")
        self._ball.move(list(from_world(place)))
        return Bottle([_OK])

    def _get(self, words: Sequence[object]) -> Bottle:
        self._of_ball("get", words)
        return Bottle([float(one) for one in to_world(self._ball.place)])

    def _delete(self, words: Sequence[object]) -> Bottle:
        if list(words) != ["all"]:
            self._of_ball("del", words)
        self._ball.hide()
        return Bottle([_OK])

    def _of_ball(self, what: str, words: Sequence[object]) -> Sequence[object]:
        """Return the words after those that name the ball."""
        named = [*words[:1]] == ["ball"]
        numbered = [*words[1:2]] == [_NUMBER] and words[0] in _SPHERES
        if not (named or numbered):
            raise RefusedError(f"{what}: this world has a ball only: {what} ball, or {what} ssph {_NUMBER}")
        if not self._ball.there:
            raise RefusedError(f"{what}: there is no ball; make one: world mk ssph RADIUS X Y Z")
        return words[1:] if named else words[2:]


def _numbers(words: Sequence[object]) -> list[float]:
    for word in words:
        if not isinstance(word, int | float):
            raise RefusedError(f"{str(word)[:_ECHO]!r} is no number")
    return [as_float(word) for word in words]  # type: ignore[arg-type]  # numbers, see above
