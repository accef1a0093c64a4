"""The requests of Cartesian control as one table, see :mod:`rtf.robot.network.request_table`.

The protocol is version 2.0 of ``cartesiancontrollerserver`` of the iCub.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Value, Vocab, as_vocab
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces.cartesian import CartesianSolution
from rtf.robot.network.elements import inner, number, shown, whole
from rtf.robot.network.request_table import (
    FLOAT,
    FLOATS,
    INT,
    NOTHING,
    POSE,
    POSE_SIZE,
    POSITION_SIZE,
    RANGE,
    SEVEN,
    TEXT,
    Kind,
    RequestTable,
    alone,
    array,
    choice,
    common,
    finite,
    floats,
    row,
    setting,
    vector,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray, Values

GO, VELOCITY, FULL, POSITION = (Vocab(word) for word in ("go", "tvel", "full", "xyz"))
_TARGET, _POSE, _REACHED, _JOINTS = (Vocab(word) for word in ("xd", "pose", "x", "q"))
_UNCHANGED = 2  # of a joint that stays active, or not


def _kind(target: FloatArray) -> Vocab:
    return POSITION if target.size == POSITION_SIZE else FULL


def _motion(target: Values, duration: float | None) -> list[Value]:
    goal = vector(target, POSITION_SIZE, POSE_SIZE)
    return [_kind(goal), finite(0.0 if duration is None else duration), floats(goal)]


def motion_of(values: Sequence[Value]) -> tuple[FloatArray, float | None]:
    """Decode what follows ``[go]``: the target, and the duration if it is above 0. Raises RefusedError."""
    if len(values) < 3:  # noqa: PLR2004 - kind, duration, target
        raise RefusedError("a motion has a kind, a duration and a target")
    kind, duration, target = as_vocab(values[0]), number(values[1]), array(values[2], POSITION_SIZE, POSE_SIZE)
    if kind not in (FULL, POSITION) or (kind == FULL and target.size != POSE_SIZE):
        raise RefusedError(f"a motion to {shown(values[0])} does not have a target of {target.size} numbers")
    return target[:POSITION_SIZE] if kind == POSITION else target, duration if duration > 0.0 else None


def _question(target: Values, start: Values | None) -> list[Value]:
    goal = vector(target, POSITION_SIZE, POSE_SIZE)
    begin = [] if start is None else [Bottle([_JOINTS, floats(start)])]
    return [Bottle([_TARGET, floats(goal)]), *begin, Bottle([_POSE, _kind(goal)])]


def _question_of(values: Sequence[Value]) -> tuple[FloatArray, FloatArray | None]:
    """Decode what follows ``[ask]``: target and start. Raises RefusedError."""
    found = {as_vocab(one[0]): one[1] for one in map(inner, values) if len(one) > 1}
    target = array(found.get(_TARGET), POSITION_SIZE, POSE_SIZE)
    start = array(found[_JOINTS]) if _JOINTS in found else None
    only_position = _POSE in found and as_vocab(found[_POSE]) == POSITION
    return target[:POSITION_SIZE] if only_position else target, start


def _solution_of(values: Sequence[Value]) -> tuple[CartesianSolution]:
    """Decode the lists ``([x] (pose)) ([q] (joints))``. Raises RefusedError."""
    found = {as_vocab(one[0]): one[1] for one in map(inner, values) if len(one) > 1}
    return (CartesianSolution(array(found.get(_REACHED), POSE_SIZE), array(found.get(_JOINTS))),)


def _solution(found: CartesianSolution) -> list[Value]:
    return [Bottle([_REACHED, floats(found.pose)]), Bottle([_JOINTS, floats(found.joints)])]


def _active(value: Value) -> tuple[bool | None, ...]:
    numbers = [whole(one) for one in inner(value)]
    return tuple(None if one not in (0, 1) else bool(one) for one in numbers)


def _actives(values: Sequence[bool | None]) -> Bottle:
    return Bottle([_UNCHANGED if one is None else int(one) for one in values])


TRUTH, _TRACKING = choice(Vocab("true"), Vocab("fals")), choice(Vocab("cont"), Vocab("shot"))
_ACTIVE = alone(_actives, _active)
_JOINT_RANGE = Kind(
    lambda joint, low, high: [int(joint), finite(low), finite(high)],
    lambda values: (whole(values[0] if values else None), *(number(one) for one in values[1:3])),
)
_SOLUTION = Kind(_solution, _solution_of)

TABLE = RequestTable(
    (
        *common(silent=True),
        row("go", "go_to", Kind(_motion, motion_of)),
        row("ask", "ask", Kind(_question, _question_of), _SOLUTION),
        row("get done", "motion_done", NOTHING, TRUTH),
        row("get ison", "solver_connected", NOTHING, TRUTH),
        row("get pose", "pose", INT, POSE),
        row("get des", "desired", NOTHING, _SOLUTION),
        row("get qdot", "joint_velocities", NOTHING, FLOATS),
        row("get xdot", "task_velocity", NOTHING, SEVEN),
        *setting("mode", "tracking", _TRACKING),
        *setting("refe", "reference_feedback", TRUTH),
        *setting("prio", "priority", TEXT),
        *setting("time", "trajectory_time", FLOAT),
        *setting("tol", "tolerance", FLOAT),
        *setting("dof", "active_joints", _ACTIVE, obtained=True),
        *setting("resp", "rest_posture", FLOATS, obtained=True),
        *setting("resw", "rest_weights", FLOATS, obtained=True),
        *setting("tip", "tip", SEVEN),
        row("get lim", "limits", INT, RANGE),
        row("set lim", "set_limits", _JOINT_RANGE),
        row("even regi ogoi", "add_checkpoint", FLOAT),
        row("even unre ogoi", "remove_checkpoint", FLOAT),
        row("even list ogoi", "checkpoints", NOTHING, FLOATS),
    ),
    spell=Vocab.truncated,
)
