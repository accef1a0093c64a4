"""Answers the questions that are put to a control board of YARP 3, by the table in :mod:`rtf.robot.vocabulary`."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

from rtf import clock
from rtf.bottle import Bottle, Value, Vocab, as_vocab
from rtf.robot import vocabulary
from rtf.robot.errors import NotSupportedError, RefusedError, RobotError
from rtf.robot.interfaces import IAxisInfo, IPidControl
from rtf.robot.vocabulary import COMMANDS, FAIL, FAMILIES, IS, NAK, OK, TOPICS, Echo, Shape, Topic
from rtf.robot.vocabulary_kinds import NOTHING, PID_TYPE, TEXT, inner, whole

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

_LEAST = 2
_WORDS = (Vocab, str, int)


class Questions:
    """Answers for one device, from any thread. ``report`` is told when a method of the device fails unexpectedly.

    What the device refuses, what it has not got and what nobody understands is answered ``[fail]``, a single word
    ``[nak]``. Stamps are counted from 0, also for questions that fail, and give the robot's time.
    """

    def __init__(self, device: object, report: Callable[[str], None]) -> None:
        self._device = device
        self._report = report
        self._count = itertools.count()
        self._has: set[type[Any]] = set()  # interfaces of the device, as far as they were asked for

    def answer(self, question: Bottle) -> Bottle:
        """The answer to a question, whatever it is."""
        if len(question) < _LEAST:
            return Bottle.adopt([NAK])
        try:
            return Bottle.adopt(self._answer(question))
        except RobotError:
            return Bottle.adopt([FAIL])
        except Exception as error:  # noqa: BLE001 - a device's fault, which its port survives
            self._report(f"[{question.to_text()[:100]}] failed: {type(error).__name__}: {error}")
            return Bottle.adopt([FAIL])

    def _answer(self, question: Bottle) -> list[Value]:
        words = question.elements()
        verb = _word(words[0])
        if verb == "get":
            return self._get(words)
        if verb == "set":
            self._set(words)
            return [OK]
        return [OK if self._command(verb, words) else FAIL]

    # Getting -----------------------------------------------------------------------------------------------------

    def _get(self, question: list[Value]) -> list[Value]:
        first = _word(question[1])
        if first == vocabulary.PROTOCOL_VERSION.text:
            return [vocabulary.PROTOCOL_VERSION, *vocabulary.PROTOCOL, OK]
        family = FAMILIES.get(first) or FAMILIES[""]
        stamp: list[Value] = []
        if family.stamped:  # counted for what fails, too
            stamp = [vocabulary.STAMP, next(self._count), clock.current().now()]
        topic, arguments = _topic(first, question)
        if topic is None or not topic.get:
            raise RefusedError(f"{_shown(question)} is no question")
        data = self._data(topic, arguments)
        return [*_echo(family.echo, topic, question), *data, *stamp, OK]

    def _data(self, topic: Topic, arguments: Sequence[Value]) -> list[Value]:
        lead, arguments = _lead(topic, arguments)
        method = self._method(topic, topic.get)
        shape, write = topic.shape, topic.kind.write
        if shape is Shape.NONE:
            return write(method(*lead))
        if shape is Shape.NAMED:
            return write(method(*lead, *TEXT.read(arguments[:1])))
        if shape is Shape.EACH:
            return write([method(*lead, joint) for joint in range(self._axes())])
        if shape is Shape.SINGLE:
            return write(method(*lead, _joint(arguments)))
        axes, _ = _selection(shape, arguments)
        found = method(*lead, axes)
        if topic.together:
            return write(found)
        values = [element for value in found for element in write(value)]
        return values if shape is Shape.ONE else [Bottle.adopt(values)]

    # Setting -----------------------------------------------------------------------------------------------------

    def _set(self, question: list[Value]) -> None:
        topic, arguments = _topic(_word(question[1]), question)
        if topic is None and _word(question[1]) == "icmd":
            topic = TOPICS["icmd", "cmod"]  # old clients say what mode it is instead, for one joint
        if topic is None or not topic.set:
            raise RefusedError(f"{_shown(question)} is nothing that can be set")
        self._put(topic, arguments)

    def _put(self, topic: Topic, arguments: Sequence[Value]) -> None:
        lead, arguments = _lead(topic, arguments)
        method = self._method(topic, topic.set)
        shape = topic.shape
        read = (topic.given or topic.kind).read
        if shape is Shape.NONE:
            method(*lead, *read(arguments))
        elif shape is Shape.NAMED:
            method(*lead, *TEXT.read(arguments[:1]), *read(arguments[1:]))
        elif shape is Shape.SINGLE:
            method(*lead, _joint(arguments), *read(arguments[1:]))
        else:
            axes, rest = _selection(shape, arguments)
            if topic.kind is NOTHING:
                method(*lead, axes)
                return
            values = rest if shape is Shape.ONE else inner(rest[0] if len(rest) == 1 else None)
            method(*lead, [read([value])[0] for value in values], axes)  # whose number is the device's to judge

    # Commands ----------------------------------------------------------------------------------------------------

    def _command(self, verb: str, question: list[Value]) -> bool:
        topic = COMMANDS.get(verb)
        if topic is None:
            raise RefusedError(f"{_shown(question)} is no command")
        if topic.get:
            return bool(self._method(topic, topic.get)(_joint(question[1:])))
        self._put(topic, question[1:])
        return True

    # The device --------------------------------------------------------------------------------------------------

    def _method(self, topic: Topic, name: str) -> Callable[..., Any]:  # each row of the table knows what it gives
        interface = topic.interface
        if interface not in self._has:
            if not isinstance(self._device, interface):
                raise NotSupportedError(f"the device has no {interface.__name__}")
            self._has.add(interface)
        return getattr(self._device, name)  # type: ignore[no-any-return]

    def _axes(self) -> int:
        if not isinstance(self._device, IAxisInfo):
            raise NotSupportedError("the device does not say how many axes it has")
        return self._device.axes()


def _word(value: Value) -> str:
    """The text of a word; vocabs are often typed as strings, of which four letters count."""
    if type(value) is Vocab:  # as programs send them
        return value.text
    return as_vocab(value).text if isinstance(value, _WORDS) else ""


def _shown(question: list[Value]) -> str:
    return repr(Bottle.adopt(question).to_text()[:60])


def _topic(first: str, question: list[Value]) -> tuple[Topic | None, list[Value]]:
    """The row that a question belongs to, and its arguments."""
    if first not in FAMILIES or not first:
        return TOPICS.get((first,)), question[2:]
    method = _word(question[2]) if len(question) > _LEAST else ""
    return TOPICS.get((first, method)), question[3:]


def _lead(topic: Topic, arguments: Sequence[Value]) -> tuple[tuple[object, ...], Sequence[Value]]:
    """What is passed to the method before anything else, and the other arguments."""
    if topic.interface is IPidControl:
        return PID_TYPE.read(arguments[:1]), arguments[1:]
    return topic.fixed, arguments


def _joint(arguments: Sequence[Value]) -> int:
    return whole(arguments[0] if len(arguments) else None)


def _selection(shape: Shape, arguments: Sequence[Value]) -> tuple[int | list[int] | None, Sequence[Value]]:
    """The axes that are chosen, and the arguments behind them."""
    if shape is Shape.ALL:
        return None, arguments
    if shape is Shape.ONE:
        return _joint(arguments), arguments[1:]
    joints = inner(arguments[1] if len(arguments) > 1 else None, _joint(arguments))
    return [whole(joint) for joint in joints], arguments[2:]


def _echo(echo: Echo, topic: Topic, question: list[Value]) -> list[Value]:
    if echo is Echo.TOPIC:
        return [IS, question[1]]
    if echo is Echo.METHOD:
        return [IS, question[3] if topic.shape is Shape.ONE else question[2]]
    return [IS] if echo is Echo.BARE_IS else []
