"""Answers the questions that are put to a control board of YARP 3, by the table in :mod:`rtf.robot.vocabulary`.

Each row of the table becomes a function when the server is made: what the row says is looked up once, and not with
every question.
"""

from __future__ import annotations

import itertools
from collections import defaultdict
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from rtf.bottle import Bottle, Value, Vocab, as_vocab
from rtf.clock import current
from rtf.robot import vocabulary
from rtf.robot.errors import NotSupportedError, RefusedError, RobotError
from rtf.robot.interfaces import IAxisInfo, PidType
from rtf.robot.vocabulary import (
    COMMANDS,
    FAIL,
    FAMILIES,
    GET,
    IS,
    NAK,
    OK,
    PLURAL,
    PROTOCOL_VERSION,
    SET,
    STAMP,
    TOPICS,
    Echo,
    Family,
    Shape,
    Topic,
    word,
)
from rtf.robot.vocabulary_kinds import NOTHING, PID_TYPE, TEXT, inner, whole

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

T = TypeVar("T")
#: Makes the elements of an answer, or the data in it, of the elements of a question; raises what the device does.
Answer: TypeAlias = "Callable[[list[Value]], list[Value]]"
#: Does what the elements of a question say.
Doing: TypeAlias = "Callable[[list[Value]], object]"

_LEAST = 2
_WORDS = (Vocab, str, int)
_NO_WORD = Vocab(0)


class Questions:
    """Answers for one device, from any thread. ``report`` is told when a method of the device fails unexpectedly.

    What the device refuses, what it has not got and what nobody understands is answered ``[fail]``, a single word
    ``[nak]``. Stamps are counted from 0, also for questions that fail, and give the robot's time.
    """

    def __init__(self, device: object, report: Callable[[str], None]) -> None:
        self._device = device
        self._report = report
        self._count = itertools.count()
        self._unknown = self._refusing(FAMILIES[""])
        self._getting = _by_first(
            ((topic, self._getter(topic)) for topic in TOPICS.values() if topic.get),
            {word(text): self._refusing(family) for text, family in FAMILIES.items() if text},
        )
        self._getting[PROTOCOL_VERSION] = lambda _: [PROTOCOL_VERSION, *vocabulary.PROTOCOL, OK]
        one_mode = self._setter(TOPICS["icmd", "cmod"])  # old clients say what mode it is instead, for one joint
        self._setting = _by_first(
            ((topic, self._setter(topic)) for topic in TOPICS.values() if topic.set), {word("icmd"): one_mode}
        )
        self._commands = {word(text): self._command(topic) for text, topic in COMMANDS.items()}

    def answer(self, question: Bottle) -> Bottle:
        """The answer to a question, whatever it is. Flat: each call of a function here is felt in the round trip."""
        words = question.elements()
        if len(words) < _LEAST:
            return Bottle.adopt([NAK])
        try:
            verb, first = words[0], words[1]
            if type(verb) is not Vocab:
                verb = _spoken(verb)
            if type(first) is not Vocab:
                first = _spoken(first)
            if verb is GET or verb == GET:
                return Bottle.adopt(self._getting.get(first, self._unknown)(words))
            if verb is SET or verb == SET:
                return Bottle.adopt(self._setting.get(first, _refuse)(words))
            return Bottle.adopt(self._commands.get(verb, _refuse)(words))
        except RobotError:
            return Bottle.adopt([FAIL])
        except Exception as error:  # noqa: BLE001 - a device's fault, which its port survives
            self._report(f"[{question.to_text()[:100]}] failed: {type(error).__name__}: {error}")
            return Bottle.adopt([FAIL])

    # Whole answers ---------------------------------------------------------------------------------------------------

    def _getter(self, topic: Topic) -> Answer:
        """What gets a topic: behind its echo, and before its stamp."""
        echo, stamped, _ = topic.family
        find, count = self._finding(topic, 1 + len(topic.words)), self._count
        begin = [] if echo is Echo.NOTHING else [IS]
        echoed = _echoed(echo, topic)

        def answer(words: list[Value]) -> list[Value]:
            stamp = (STAMP, next(count), current().now()) if stamped else ()  # counted for what fails, too
            data = find(words)
            return [*begin, *words[echoed], *data, *stamp, OK]

        return answer

    def _refusing(self, family: Family) -> Answer:
        """What becomes of a topic that a family has not got; it is counted like one that it has."""
        count = self._count if family.stamped else iter(())

        def answer(words: list[Value]) -> list[Value]:
            next(count, 0)
            return _refuse(words)

        return answer

    def _setter(self, topic: Topic, verbs: int = 1) -> Answer:
        """What sets a topic. It stands behind so many words that say what is to be done with it."""
        do = self._doing(topic, verbs + len(topic.words))

        def answer(words: list[Value]) -> list[Value]:
            do(words)
            return [OK]

        return answer

    def _command(self, topic: Topic) -> Answer:
        """What carries out a word that stands alone."""
        if not topic.get:
            return self._setter(topic, 0)
        method = self._method(topic, topic.get)
        return lambda words: [OK if method(_joint(words, 1)) else FAIL]

    # What rows of the table do; ``at`` is where the arguments of a question begin ----------------------------------

    def _finding(self, topic: Topic, at: int) -> Answer:
        """What makes the data of an answer."""
        method = self._method(topic, topic.get)
        if topic.family.typed:
            return _for_each_type(lambda lead: self._found(topic, partial(method, lead), at + 1), at)
        return self._found(topic, method, at)

    def _found(self, topic: Topic, method: Callable[..., Any], at: int) -> Answer:
        shape, write = topic.shape, topic.kind.write
        if shape in PLURAL:
            return _found_of_axes(topic, method, at)
        if shape is Shape.SINGLE:
            return lambda words: write(method(_joint(words, at)))
        if shape is Shape.NAMED:
            return lambda words: write(method(*TEXT.read(words[at : at + 1])))
        if shape is Shape.EACH:
            return lambda _: write([method(joint) for joint in range(self._axes())])
        return lambda _: write(method())

    def _doing(self, topic: Topic, at: int) -> Doing:
        """What carries out what is set."""
        method = self._method(topic, topic.set)
        if topic.family.typed:
            return _for_each_type(lambda lead: self._done(topic, partial(method, lead), at + 1), at)
        return self._done(topic, partial(method, *topic.fixed) if topic.fixed else method, at)

    def _done(self, topic: Topic, method: Callable[..., Any], at: int) -> Doing:
        shape, read = topic.shape, (topic.given or topic.kind).read
        if shape is Shape.NONE:
            return lambda words: method(*read(words[at:]))
        if shape is Shape.NAMED:
            return lambda words: method(*TEXT.read(words[at : at + 1]), *read(words[at + 1 :]))
        if shape is Shape.SINGLE:
            return lambda words: method(_joint(words, at), *read(words[at + 1 :]))
        select, behind = _selecting(shape), at + _SELECTION[shape]
        if topic.kind is NOTHING:
            return lambda words: method(select(words, at))
        if shape is Shape.ONE:  # how many values there must be is the device's to judge, here and below
            return lambda words: method([read([value])[0] for value in words[behind:]], _joint(words, at))
        return lambda words: method([read([value])[0] for value in _listed(words, behind)], select(words, at))

    # The device ------------------------------------------------------------------------------------------------------

    def _method(self, topic: Topic, name: str) -> Callable[..., Any]:  # each row of the table knows what it gives
        if isinstance(self._device, topic.interface):
            return getattr(self._device, name)  # type: ignore[no-any-return]
        return partial(_missing, topic.interface)

    def _axes(self) -> int:
        if not isinstance(self._device, IAxisInfo):
            raise NotSupportedError("the device does not say how many axes it has")
        return self._device.axes()


# Words ---------------------------------------------------------------------------------------------------------------


def _spoken(value: Value) -> Vocab:
    """The word that somebody typed as a string, of which four letters count, or as a number."""
    return as_vocab(value) if isinstance(value, _WORDS) else _NO_WORD


def _by_first(answers: Iterable[tuple[Topic, Answer]], otherwise: dict[Vocab, Answer]) -> dict[Vocab, Answer]:
    """What answers, by the second word of a question; that of a family looks at the third word itself.

    What it does not know there it gives to the family's own of ``otherwise``.
    """
    found: dict[Vocab, Answer] = {}
    families: dict[Vocab, dict[Vocab, Answer]] = defaultdict(dict)
    for topic, answer in answers:
        first, *further = map(word, topic.words)
        if further:
            families[first][further[0]] = answer
        else:
            found[first] = answer
    for first, methods in families.items():
        found[first] = _by_method(methods, otherwise.get(first, _refuse))
    return found


def _by_method(methods: dict[Vocab, Answer], otherwise: Answer) -> Answer:
    """What answers by the third word of a question."""

    def answer(words: list[Value]) -> list[Value]:
        method = words[2] if len(words) > _LEAST else _NO_WORD
        if type(method) is not Vocab:
            method = _spoken(method)
        return methods.get(method, otherwise)(words)

    return answer


def _for_each_type(make: Callable[[PidType], Callable[[list[Value]], T]], at: int) -> Callable[[list[Value]], T]:
    """What does the same for each type of controller, which stands before the other arguments."""
    made = {kind: make(kind) for kind in PidType}
    return lambda words: made[PID_TYPE.read(words[at : at + 1])[0]](words)


def _found_of_axes(topic: Topic, method: Callable[..., Any], at: int) -> Answer:
    """What makes the data of an answer by a method that takes any choice of axes."""
    shape, write, select = topic.shape, topic.kind.write, _selecting(topic.shape)
    if topic.together:
        return lambda words: write(method(select(words, at)))
    if shape is Shape.ONE:
        return lambda words: [element for value in method(_joint(words, at)) for element in write(value)]
    return lambda words: [Bottle.adopt([one for value in method(select(words, at)) for one in write(value)])]


def _refuse(words: list[Value]) -> list[Value]:
    raise RefusedError(f"{Bottle.adopt(words).to_text()[:60]!r} means nothing")


def _missing(interface: type[Any], *_: object) -> None:
    raise NotSupportedError(f"the device has no {interface.__name__}")


# Axes ----------------------------------------------------------------------------------------------------------------

#: How many arguments say which axes are meant.
_SELECTION = {Shape.ALL: 0, Shape.ONE: 1, Shape.GROUP: 2}


def _joint(words: list[Value], at: int) -> int:
    return whole(words[at] if len(words) > at else None)


def _listed(words: list[Value], at: int) -> Bottle:
    """The list of values that is the last of the arguments."""
    return inner(words[at] if len(words) == at + 1 else None)


def _group(words: list[Value], at: int) -> list[int]:
    joints = inner(words[at + 1] if len(words) > at + 1 else None, _joint(words, at))
    return [whole(joint) for joint in joints]


def _selecting(shape: Shape) -> Callable[[list[Value], int], int | list[int] | None]:
    """What finds the axes that a question chooses."""
    if shape is Shape.ALL:
        return lambda _words, _at: None
    return _joint if shape is Shape.ONE else _group


def _echoed(echo: Echo, topic: Topic) -> slice:
    """The words of a question that its answer repeats."""
    if echo is Echo.TOPIC:
        return slice(1, 2)
    if echo is Echo.METHOD:
        return slice(3, 4) if topic.shape is Shape.ONE else slice(2, 3)
    return slice(0)
