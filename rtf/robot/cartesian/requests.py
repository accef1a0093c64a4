"""The requests of Cartesian control as one table: the words of each, its method, its arguments and its result.

The protocol is version 2.0 of ``cartesiancontrollerserver`` of the iCub. Reading is strict, as these requests move
robots: see :mod:`rtf.robot.network.elements`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rtf.bottle import Bottle, Value, Vocab, as_vocab
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces.cartesian import CartesianEvent, CartesianPose, CartesianSolution
from rtf.robot.network.elements import inner, number, shown, whole

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.robot.interfaces import FloatArray

VERSION = "2.0"
ACK, NACK = Vocab("ack"), Vocab("nack")
GO, ASK, VELOCITY, FULL, POSITION = (Vocab(word) for word in ("go", "ask", "tvel", "full", "xyz"))
TARGET, POSE, JOINTS, START = (Vocab(word) for word in ("xd", "pose", "x", "q"))
#: The numbers of a position, and those of a pose and of a velocity.
POSITION_SIZE, POSE_SIZE = 3, 7
_UNCHANGED = 2  # of a joint that stays active, or not
_TRUE, _FALSE = Vocab("true"), Vocab("fals")
_CONTINUOUS, _SHOT = Vocab("cont"), Vocab("shot")


class Kind(NamedTuple):
    """Arguments or a result: ``write`` makes elements of them, ``read`` a tuple of elements, or raises RefusedError."""

    write: Callable[..., list[Value]]
    read: Callable[[Sequence[Value]], tuple[Any, ...]]


def floats(values: Sequence[float] | FloatArray) -> Bottle:
    """Return numbers as a list. Raises RefusedError unless all are finite."""
    given = [float(value) for value in values]
    if not all(map(math.isfinite, given)):
        raise RefusedError(f"{given} are not all finite numbers")
    return Bottle.adopt([*given])


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


def _one(values: Sequence[Value]) -> Value:
    if len(values) != 1:
        raise RefusedError(f"one value is needed, not {len(values)}")
    return values[0]


def _alone(write: Callable[[Any], Value], read: Callable[[Value], Any]) -> Kind:
    return Kind(lambda value: [write(value)], lambda values: (read(_one(values)),))


def _choice(yes: Vocab, no: Vocab) -> Kind:
    def read(value: Value) -> bool:
        if as_vocab(value) not in (yes, no):
            raise RefusedError(f"{yes} or {no} is needed, not {shown(value)}")
        return as_vocab(value) == yes

    return _alone(lambda value: yes if value else no, read)


def _text(value: Value) -> str:
    if isinstance(value, str):
        return value
    raise RefusedError(f"a word is needed, not {shown(value)}")


def _pose(values: Sequence[Value]) -> tuple[CartesianPose]:
    """Decode a pose with its stamp; a stamp without a time is one of 0."""
    vector, stamp = values if len(values) > 1 else (_one(values), Bottle([0, 0.0]))
    return (CartesianPose(array(vector, POSE_SIZE), number(inner(stamp, 2)[1])),)


def solution_of(values: Sequence[Value]) -> CartesianSolution:
    """Decode the lists ``([x] (pose)) ([q] (joints))``. Raises RefusedError."""
    found = {as_vocab(one[0]): one[1] for one in map(inner, values) if len(one) > 1}
    return CartesianSolution(array(found.get(JOINTS), POSE_SIZE), array(found.get(START)))


def solution(found: CartesianSolution) -> list[Value]:
    """Encode it."""
    return [Bottle([JOINTS, floats(found.pose)]), Bottle([START, floats(found.joints)])]


def _active(value: Value) -> tuple[bool | None, ...]:
    numbers = [whole(one) for one in inner(value)]
    return tuple(None if one not in (0, 1) else bool(one) for one in numbers)


def _actives(values: Sequence[bool | None]) -> Bottle:
    return Bottle([_UNCHANGED if one is None else int(one) for one in values])


NOTHING = Kind(list, lambda _: ())
FLOAT = _alone(float, number)
INT = _alone(int, whole)
TEXT = _alone(str, _text)
FLOATS = _alone(floats, array)
SEVEN = _alone(floats, lambda value: array(value, POSE_SIZE))
WHOLES = _alone(lambda values: Bottle([*map(int, values)]), lambda value: tuple(whole(one) for one in inner(value)))
ACTIVE = _alone(_actives, _active)
PAIRS = _alone(lambda value: value, inner)
TRUTH, TRACKING = _choice(_TRUE, _FALSE), _choice(_CONTINUOUS, _SHOT)
RANGE = Kind(lambda limits: [*map(float, limits)], lambda values: (tuple(number(one) for one in values),))
JOINT_RANGE = Kind(
    lambda joint, low, high: [int(joint), float(low), float(high)],
    lambda values: (whole(values[0] if values else None), *(number(one) for one in values[1:3])),
)
LINK_POSE = Kind(lambda found: [floats(found.vector), Bottle([0, float(found.time)])], _pose)
SOLUTION = Kind(solution, lambda values: (solution_of(values),))


class Request(NamedTuple):
    """A request: its words, the method of ICartesianControl, what that takes and gives."""

    words: tuple[Vocab, ...]
    method: str
    takes: Kind = NOTHING
    gives: Kind = NOTHING
    #: Whether a request without arguments is answered with nothing at all, as the original does.
    silent: bool = False


def _row(words: str, method: str, takes: Kind = NOTHING, gives: Kind = NOTHING, *, silent: bool = False) -> Request:
    return Request(tuple(Vocab(word) for word in words.split()), method, takes, gives, silent)


def _setting(word: str, name: str, kind: Kind, *, obtained: bool = False) -> tuple[Request, Request]:
    """Return the two requests of a setting; ``obtained``: setting it gives what it is then."""
    setting = _row(f"set {word}", f"set_{name}", kind, kind if obtained else NOTHING)
    return _row(f"get {word}", name, NOTHING, kind), setting


#: All requests but those to move and to ask the solver.
REQUESTS: tuple[Request, ...] = (
    _row("stop", "stop"),
    _row("get done", "motion_done", NOTHING, TRUTH),
    _row("get ison", "solver_connected", NOTHING, TRUTH),
    _row("get pose", "pose", INT, LINK_POSE),
    _row("get des", "desired", NOTHING, SOLUTION),
    _row("get qdot", "joint_velocities", NOTHING, FLOATS),
    _row("get xdot", "task_velocity", NOTHING, SEVEN),
    _row("get info", "info", NOTHING, PAIRS),
    *_setting("mode", "tracking", TRACKING),
    *_setting("refe", "reference_feedback", TRUTH),
    *_setting("prio", "priority", TEXT),
    *_setting("time", "trajectory_time", FLOAT),
    *_setting("tol", "tolerance", FLOAT),
    *_setting("dof", "active_joints", ACTIVE, obtained=True),
    *_setting("resp", "rest_posture", FLOATS, obtained=True),
    *_setting("resw", "rest_weights", FLOATS, obtained=True),
    *_setting("tip", "tip", SEVEN),
    *_setting("twea", "tweaks", PAIRS),
    _row("get lim", "limits", INT, RANGE),
    _row("set lim", "set_limits", JOINT_RANGE),
    _row("stor", "store_context", NOTHING, INT),
    _row("rest", "restore_context", INT, silent=True),
    _row("del", "delete_contexts", WHOLES, silent=True),
    _row("even regi ogoi", "add_checkpoint", FLOAT),
    _row("even unre ogoi", "remove_checkpoint", FLOAT),
    _row("even list ogoi", "checkpoints", NOTHING, FLOATS),
)
BY_WORDS = {request.words: request for request in REQUESTS}
BY_METHOD = {request.method: request for request in REQUESTS}


def motion(target: FloatArray, duration: float | None) -> Bottle:
    """Return the request, or the streamed command, for a motion to a pose or a position. Raises RefusedError."""
    kind = POSITION if target.size == POSITION_SIZE else FULL
    [time] = floats([0.0 if duration is None else duration])
    return Bottle([GO, kind, time, floats(target)])


def motion_of(values: Sequence[Value]) -> tuple[FloatArray, float | None]:
    """Decode what follows ``[go]``: the target, and the duration if it is above 0. Raises RefusedError."""
    if len(values) < 3:  # noqa: PLR2004 - kind, duration, target
        raise RefusedError("a motion has a kind, a duration and a target")
    kind, duration, target = as_vocab(values[0]), number(values[1]), array(values[2], POSITION_SIZE, POSE_SIZE)
    if kind not in (FULL, POSITION) or (kind == FULL and target.size != POSE_SIZE):
        raise RefusedError(f"a motion to {shown(values[0])} does not have a target of {target.size} numbers")
    return target[:POSITION_SIZE] if kind == POSITION else target, duration if duration > 0.0 else None


def question(target: FloatArray, start: FloatArray | None) -> Bottle:
    """Return the request that asks the solver. Raises RefusedError."""
    kind = POSITION if target.size == POSITION_SIZE else FULL
    parts: list[Value] = [Bottle([TARGET, floats(target)])]
    if start is not None:
        parts.append(Bottle([START, floats(start)]))
    return Bottle([ASK, *parts, Bottle([POSE, kind])])


def question_of(values: Sequence[Value]) -> tuple[FloatArray, FloatArray | None]:
    """Decode what follows ``[ask]``: target and start. Raises RefusedError."""
    found = {as_vocab(one[0]): one[1] for one in map(inner, values) if len(one) > 1}
    target = array(found.get(TARGET), POSITION_SIZE, POSE_SIZE)
    start = array(found[START]) if START in found else None
    only_position = POSE in found and as_vocab(found[POSE]) == POSITION
    return target[:POSITION_SIZE] if only_position else target, start


def event(happened: CartesianEvent) -> Bottle:
    """Return an event as a message."""
    share = [] if happened.checkpoint is None else [float(happened.checkpoint)]
    return Bottle([happened.name, float(happened.time), *share])


def event_of(message: Bottle) -> CartesianEvent:
    """Decode an event. Raises RefusedError."""
    name, time, *rest = [*message, None, None][: max(len(message), 2)]
    return CartesianEvent(_text(name if name is not None else 0), number(time), number(rest[0]) if rest else None)
