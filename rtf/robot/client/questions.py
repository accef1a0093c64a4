"""The questions that a client puts, by the method of a device that they are for; made from the vocabulary's table."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rtf.bottle import Value, Vocab
from rtf.robot import vocabulary
from rtf.robot import vocabulary_kinds as kinds
from rtf.robot.vocabulary import GET, SET, Echo, Shape

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.robot.vocabulary import Streamed, Topic
    from rtf.robot.vocabulary_kinds import Kind

#: How many elements stand before the data of an answer.
_HEADS = {Echo.TOPIC: 2, Echo.METHOD: 2, Echo.BARE_IS: 1, Echo.NOTHING: 0}
#: ``[ok]``, and before it ``[tsta]``, a count and the time.
_TAIL, _STAMPED_TAIL = 1, 4


class Question(NamedTuple):
    """What is asked, and where in the answer the data are: behind ``head`` elements, before the ``tail`` last."""

    words: tuple[Value, ...]
    kind: Kind
    head: int = 0
    tail: int = _TAIL


#: The questions for a method, by what is said of the axes.
Questions = dict[Shape, Question]


def _question(topic: Topic, verb: Vocab) -> Question:
    family = topic.family
    kind = topic.given if verb == SET and topic.given is not None else topic.kind
    tail = _STAMPED_TAIL if family.stamped else _TAIL
    return Question((verb, *map(Vocab, topic.words)), kind, _HEADS[family.echo], tail)


def _by_method() -> tuple[dict[str, Questions], dict[str, Questions]]:
    """What is asked to get, and what to set."""
    getting: dict[str, Questions] = {}
    setting: dict[str, Questions] = {}
    for topic in vocabulary.TOPICS.values():
        if topic.fixed:
            continue  # a shorthand for what is said in full, too
        if topic.get:
            getting.setdefault(topic.get, {}).setdefault(topic.shape, _question(topic, GET))
        if topic.set:
            setting.setdefault(topic.set, {}).setdefault(topic.shape, _question(topic, SET))
    return getting, setting


def _heads() -> dict[str, dict[Shape, tuple[Value, ...]]]:
    found: dict[str, dict[Shape, tuple[Value, ...]]] = {}
    command: Streamed
    for command in vocabulary.STREAMED.values():
        found.setdefault(command.method, {})[command.shape] = tuple(map(Vocab, command.words))
    return found


GETTING: Mapping[str, Questions]
SETTING: Mapping[str, Questions]
GETTING, SETTING = _by_method()
#: The heads of the commands that are streamed.
HEADS: Mapping[str, Mapping[Shape, tuple[Value, ...]]] = _heads()

# What stands alone in the protocol.
PROTOCOL = Question((GET, Vocab("prot")), kinds.INT)
CALIBRATE = Question((Vocab("calj"),), kinds.CALIBRATION)
KEEP_CALIBRATION = Question((Vocab("cljp"),), kinds.CALIBRATION)
CALIBRATION_DONE = Question((Vocab("cald"),), kinds.NOTHING)
