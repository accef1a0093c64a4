"""Messages between a Cartesian server and its solver: targets, and the postures that are the answers.

A target is ``([xd] (3|7 numbers)) ([pose] [full]|[xyz]) ([mode] [cont]|[shot]) ([tok] time)``, its answer
``([xd] (7)) ([x] (7)) ([q] (deg, of the active joints)) ([tok] time)``, with the token of the target.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rtf.bottle import Bottle, Value, Vocab, as_vocab
from rtf.robot.cartesian.requests import FULL, POSITION
from rtf.robot.errors import RefusedError
from rtf.robot.network.elements import inner, number
from rtf.robot.network.request_table import POSE_SIZE, POSITION_SIZE, array, floats

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray

TARGET, POSE, REACHED, JOINTS, TOKEN, MODE, ACTIVE, REST, WEIGHTS = (
    Vocab(word) for word in ("xd", "pose", "x", "q", "tok", "mode", "dof", "resp", "resw")
)
CONTINUOUS, SHOT = Vocab("cont"), Vocab("shot")


class TargetMessage(NamedTuple):
    """A target (3,) or (7,); whether it is tracked, None: as before; its token; None: without one.

    ``others`` are the settings that came with it, by their words.
    """

    target: FloatArray
    tracking: bool | None
    token: float | None
    others: dict[Vocab, Value]


class AnswerMessage(NamedTuple):
    """The pose (7,) that is reached, the active joints (deg) that have it, and the token; None: without one."""

    pose: FloatArray
    joints: FloatArray
    token: float | None


def write_target(target: FloatArray, token: float) -> Bottle:
    """Return a target as a message."""
    kind = POSITION if target.size == POSITION_SIZE else FULL
    pairs: list[list[Value]] = [[TARGET, floats(target)], [POSE, kind], [MODE, SHOT], [TOKEN, float(token)]]
    return Bottle([Bottle(pair) for pair in pairs])


def read_target(message: Bottle, *, whole_pose: bool) -> TargetMessage:
    """Decode a target; ``whole_pose``: whether one that does not say so is a pose. Raises RefusedError."""
    found = _members(message)
    target = array(found.get(TARGET), POSITION_SIZE, POSE_SIZE)
    kind = as_vocab(found.get(POSE)) if POSE in found else FULL if whole_pose else POSITION
    if kind == FULL and target.size < POSE_SIZE:
        raise RefusedError(f"a pose has {POSE_SIZE} numbers, not {target.size}")
    mode = as_vocab(found.get(MODE)) if MODE in found else None
    token = number(found[TOKEN]) if TOKEN in found else None
    return TargetMessage(
        target[:POSITION_SIZE] if kind == POSITION else target,
        None if mode is None else mode == CONTINUOUS,
        token,
        {word: found[word] for word in (ACTIVE, REST, WEIGHTS) if word in found},
    )


def write_answer(target: FloatArray, answer: AnswerMessage) -> Bottle:
    """Return an answer to a target (7,) as a message."""
    token = [] if answer.token is None else [Bottle([TOKEN, float(answer.token)])]
    pairs = ((TARGET, target), (REACHED, answer.pose), (JOINTS, answer.joints))
    return Bottle([*(Bottle([word, floats(values)]) for word, values in pairs), *token])


def read_answer(message: Bottle) -> AnswerMessage:
    """Decode an answer. Raises RefusedError."""
    found = _members(message)
    token = number(found[TOKEN]) if TOKEN in found else None
    return AnswerMessage(array(found.get(REACHED), POSE_SIZE), array(found.get(JOINTS)), token)


def _members(message: Bottle) -> dict[Vocab, Value]:
    members: dict[Vocab, Value] = {}
    for one in map(inner, message):
        word = as_vocab(one[0]) if len(one) > 1 else None
        if word is not None:
            members[word] = one[1]
    return members
