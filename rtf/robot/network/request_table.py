"""Requests of a controller as one table: the words of each, its method, its arguments and its result.

The conventions are those of the iCub's Cartesian and gaze controllers, version 2.0 of both: words and vocabs mean the
same, by their first four characters; a reply is ``[ack]`` and the result, or ``[nack]``. Reading is strict, as these
requests move robots: see :mod:`rtf.robot.network.elements`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rtf.bottle import Bottle, Value, Vocab, as_vocab
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import CartesianPose, ControllerEvent
from rtf.robot.network.elements import inner, number, shown, whole

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from rtf.robot.interfaces import FloatArray, Values

VERSION = "2.0"
ACK, NACK = Vocab("ack"), Vocab("nack")
#: The numbers of a position, and those of a pose.
POSITION_SIZE, POSE_SIZE = 3, 7


class Kind(NamedTuple):
    """Arguments or a result: ``write`` makes elements of them, ``read`` a tuple of elements, or raises RefusedError."""

    write: Callable[..., list[Value]]
    read: Callable[[Sequence[Value]], tuple[Any, ...]]


# Parts of kinds -------------------------------------------------------------------------------------------------------


def floats(values: Values) -> Bottle:
    """Return numbers as a list. Raises RefusedError unless all are finite."""
    return Bottle.adopt([*vector(values).tolist()])


def finite(value: float) -> float:
    """Return a number. Raises RefusedError for what is none."""
    if not math.isfinite(value):
        raise RefusedError(f"{value} is not a finite number")
    return float(value)


def array(value: Value | None, *sizes: int) -> FloatArray:
    """Return a list of numbers as an array, of one of the sizes if there are any. Raises RefusedError."""
    found = np.array([number(one) for one in inner(value)])
    if sizes and found.size not in sizes:
        raise RefusedError(f"a list of {' or '.join(map(str, sizes))} numbers is needed, not {found.size}")
    return found


def vector(values: Values, *sizes: int) -> FloatArray:
    """Return the numbers of a caller as an array, of one of the sizes if there are any. Raises RefusedError."""
    found = np.atleast_1d(np.asarray(values, dtype=np.float64))
    if found.ndim != 1 or (sizes and found.size not in sizes) or not np.isfinite(found).all():
        count = " or ".join(map(str, sizes)) + " " if sizes else ""
        raise RefusedError(f"{count}finite numbers are needed, not {found.tolist()}")
    return found


def text(value: Value) -> str:
    """Return a word. Raises RefusedError."""
    if isinstance(value, str):
        return value
    raise RefusedError(f"a word is needed, not {shown(value)}")


def alone(write: Callable[[Any], Value], read: Callable[[Value], Any]) -> Kind:
    """Return the kind of one value."""

    def one(values: Sequence[Value]) -> tuple[Any]:
        if len(values) != 1:
            raise RefusedError(f"one value is needed, not {len(values)}")
        return (read(values[0]),)

    return Kind(lambda value: [write(value)], one)


def choice(yes: Vocab, no: Vocab) -> Kind:
    """Return the kind of a boolean that is one of two words."""

    def read(value: Value) -> bool:
        if as_vocab(value) not in (yes, no):
            raise RefusedError(f"{yes} or {no} is needed, not {shown(value)}")
        return as_vocab(value) == yes

    return alone(lambda value: yes if value else no, read)


def _pose(values: Sequence[Value]) -> tuple[CartesianPose]:
    """Decode a pose with its stamp; a stamp without a time is one of 0."""
    if not values:
        raise RefusedError("a pose and its stamp are needed, not nothing")
    found, stamp = values[0], inner(values[1], 2) if len(values) > 1 else [0, 0.0]
    return (CartesianPose(array(found, POSE_SIZE), number(stamp[1])),)


NOTHING = Kind(list, lambda _: ())
FLOAT = alone(finite, number)
INT = alone(int, whole)
TEXT = alone(str, text)
FLOATS = alone(floats, array)
SEVEN = alone(floats, lambda value: array(value, POSE_SIZE))
WHOLES = alone(lambda values: Bottle([*map(int, values)]), lambda value: tuple(whole(one) for one in inner(value)))
PAIRS = alone(lambda value: value, inner)
RANGE = Kind(lambda limits: [*map(finite, limits)], lambda values: (tuple(number(one) for one in values[:2]),))
POSE = Kind(lambda found: [floats(found.vector), Bottle([0, float(found.time)])], _pose)

# Requests -------------------------------------------------------------------------------------------------------------


class Request(NamedTuple):
    """A request: its words, the method of the interface, what that takes and gives.

    ``key`` is its name among the requests, if several have the same method; ``fixed`` are arguments of the method that
    the words stand for.
    """

    words: tuple[str, ...]
    method: str
    takes: Kind = NOTHING
    gives: Kind = NOTHING
    key: str = ""
    fixed: tuple[str, ...] = ()
    #: Whether a request without arguments is answered with nothing at all, as the original does.
    silent: bool = False


def row(words: str, method: str, takes: Kind = NOTHING, gives: Kind = NOTHING, **others: Any) -> Request:
    """Return a request; ``words`` are separated by blanks."""
    return Request(tuple(words.split()), method, takes, gives, **others)


def setting(word: str, name: str, kind: Kind, *, obtained: bool = False) -> tuple[Request, Request]:
    """Return the two requests of a setting; ``obtained``: setting it gives what it is then."""
    return row(f"get {word}", name, NOTHING, kind), row(
        f"set {word}", f"set_{name}", kind, kind if obtained else NOTHING
    )


def common(*, silent: bool) -> tuple[Request, ...]:
    """Return the requests that all controllers have; ``silent``: those of contexts, see Request."""
    return (
        row("stop", "stop"),
        row("get info", "info", NOTHING, PAIRS),
        *setting("tweak", "tweaks", PAIRS),
        row("stor", "store_context", NOTHING, INT),
        row("rest", "restore_context", INT, silent=silent),
        row("del", "delete_contexts", WHOLES, silent=silent),
    )


class RequestTable:
    """Requests by their words and by their keys; ``spell`` makes what a client writes of a word."""

    def __init__(self, requests: Iterable[Request], spell: Callable[[str], Value]) -> None:
        self.requests = tuple(requests)
        self._spell = spell
        self.by_words = {tuple(map(Vocab.truncated, one.words)): one for one in self.requests}
        self.by_key = {one.key or one.method: one for one in self.requests}
        self._longest = max(len(one.words) for one in self.requests)

    def request(self, key: str, *arguments: Any) -> Bottle:
        """Return what a client sends. Raises RefusedError for arguments that cannot be sent."""
        found = self.by_key[key]
        return Bottle([*map(self._spell, found.words), *found.takes.write(*arguments)])

    def result(self, key: str, values: Sequence[Value]) -> Any:
        """Decode what follows ``[ack]``. Raises RefusedError."""
        gives = self.by_key[key].gives
        return None if gives is NOTHING else gives.read(values)[0]

    def find(self, request: Bottle) -> tuple[Request, list[Value]]:
        """Return the row of a request, and its arguments. Raises RefusedError for an unknown one."""
        words = tuple(as_vocab(value) for value in request[: self._longest])
        for count in range(len(words), 0, -1):
            found = self.by_words.get(words[:count])
            if found is not None:
                return found, list(request[count:])
        raise RefusedError(f"there is no request {request.to_text()[:80]}")

    def answer(self, control: object, request: Bottle) -> Bottle:
        """Call the method of a request, and return the reply. Raises RobotError, which stands for ``[nack]``."""
        found, arguments = self.find(request)
        if found.silent and not arguments:
            return Bottle()
        result = getattr(control, found.method)(*found.fixed, *found.takes.read(arguments))
        return Bottle([ACK, *(found.gives.write(result) if found.gives is not NOTHING else [])])


# Events ---------------------------------------------------------------------------------------------------------------


def event(happened: ControllerEvent) -> Bottle:
    """Return an event as a message."""
    share = [] if happened.checkpoint is None else [float(happened.checkpoint)]
    return Bottle([happened.name, float(happened.time), *share])


def event_of(message: Bottle) -> ControllerEvent:
    """Decode an event. Raises RefusedError."""
    name, time, *rest = [*message, None, None][: max(len(message), 2)]
    return ControllerEvent(text(name if name is not None else 0), number(time), number(rest[0]) if rest else None)
