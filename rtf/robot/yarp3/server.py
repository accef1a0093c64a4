"""The request handler of a YARP 3 control board, driven by the table in :mod:`rtf.robot.yarp3.table`.

Each row of the table becomes a function when the server is created, so a request needs no further look-ups in the row.
"""

from __future__ import annotations

import itertools
from collections import defaultdict
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from rtf.bottle import Bottle, Value, Vocab, as_vocab
from rtf.clock import current
from rtf.robot.errors import NotSupportedError, RefusedError, RobotError
from rtf.robot.interfaces import IAxisInfo, PidType
from rtf.robot.network.elements import inner, whole
from rtf.robot.yarp3 import table as vocabulary
from rtf.robot.yarp3.table import (
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
from rtf.robot.yarp3.values import NOTHING, PID_TYPE, TEXT

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

T = TypeVar("T")
#: Converts the elements of a request to those of an answer, or to its data; raises the device's errors.
Answer: TypeAlias = "Callable[[list[Value]], list[Value]]"
#: Executes the request with these elements.
Doing: TypeAlias = "Callable[[list[Value]], object]"

_LEAST = 2
_WORDS = (Vocab, str, int)
_NO_WORD = Vocab(0)


class ControlBoardRequests:
    """Answers requests to one device, in any thread. ``report`` gets unexpected errors of its methods.

    A request that is refused, not supported or not understood is answered ``[fail]``, a single word ``[nak]``. Stamps
    count from 0, including failed requests, and have the robot's time.
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
        one_mode = self._setter(TOPICS["icmd", "cmod"])  # old clients send the mode in place of this word
        self._setting = _by_first(
            ((topic, self._setter(topic)) for topic in TOPICS.values() if topic.set), {word("icmd"): one_mode}
        )
        self._commands = {word(text): self._command(topic) for text, topic in COMMANDS.items()}

    def answer(self, request: Bottle) -> Bottle:
        """Answer a request. No helper functions: each call adds to the round trip."""
        words = request.elements()
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
        except Exception as error:  # noqa: BLE001 - the port must survive errors of a device
            self._report(f"[{request.to_text()[:100]}] failed: {type(error).__name__}: {error}")
            return Bottle.adopt([FAIL])

    # Complete answers ------------------------------------------------------------------------------------------------

    def _getter(self, topic: Topic) -> Answer:
        """Return the handler that gets a topic: echo, data and stamp."""
        echo, stamped, _ = topic.family
        find, count = self._finding(topic, 1 + len(topic.words)), self._count
        begin = [] if echo is Echo.NOTHING else [IS]
        echoed = _echoed(echo, topic)

        def answer(words: list[Value]) -> list[Value]:
            stamp = (STAMP, next(count), current().now()) if stamped else ()  # failed requests count, too
            data = find(words)
            return [*begin, *words[echoed], *data, *stamp, OK]

        return answer

    def _refusing(self, family: Family) -> Answer:
        """Return the handler of unknown topics of a family; they are counted like known ones."""
        count = self._count if family.stamped else iter(())

        def answer(words: list[Value]) -> list[Value]:
            next(count, 0)
            return _refuse(words)

        return answer

    def _setter(self, topic: Topic, verbs: int = 1) -> Answer:
        """Return the handler that sets a topic, whose words follow ``verbs`` words."""
        do = self._doing(topic, verbs + len(topic.words))

        def answer(words: list[Value]) -> list[Value]:
            do(words)
            return [OK]

        return answer

    def _command(self, topic: Topic) -> Answer:
        """Return the handler of a command without get or set."""
        if not topic.get:
            return self._setter(topic, 0)
        method = self._method(topic, topic.get)
        return lambda words: [OK if method(_joint(words, 1)) else FAIL]

    # Handlers of table rows; ``at`` is the index of the first argument of a request ---------------------------------

    def _finding(self, topic: Topic, at: int) -> Answer:
        """Return the function that computes the data of an answer."""
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
        """Return the function that executes a ``set`` request."""
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
        if shape is Shape.ONE:  # the device checks the number of values, here and below
            return lambda words: method([read([value])[0] for value in words[behind:]], _joint(words, at))
        return lambda words: method([read([value])[0] for value in _listed(words, behind)], select(words, at))

    # The device ------------------------------------------------------------------------------------------------------

    def _method(self, topic: Topic, name: str) -> Callable[..., Any]:  # Any: the result depends on the row of the table
        if isinstance(self._device, topic.interface):
            return getattr(self._device, name)  # type: ignore[no-any-return]
        return partial(_missing, topic.interface)

    def _axes(self) -> int:
        if not isinstance(self._device, IAxisInfo):
            raise NotSupportedError("the device does not say how many axes it has")
        return self._device.axes()


# Words ---------------------------------------------------------------------------------------------------------------


def _spoken(value: Value) -> Vocab:
    """Convert an element to a word: a typed string, of which four letters count, or a number."""
    return as_vocab(value) if isinstance(value, _WORDS) else _NO_WORD


def _by_first(answers: Iterable[tuple[Topic, Answer]], otherwise: dict[Vocab, Answer]) -> dict[Vocab, Answer]:
    """Index the handlers by the second word of a request; the handler of a family uses the third word.

    Words unknown to a family go to its handler in ``otherwise``.
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
    """Return a handler that selects by the third word of a request."""

    def answer(words: list[Value]) -> list[Value]:
        method = words[2] if len(words) > _LEAST else _NO_WORD
        if type(method) is not Vocab:
            method = _spoken(method)
        return methods.get(method, otherwise)(words)

    return answer


def _for_each_type(make: Callable[[PidType], Callable[[list[Value]], T]], at: int) -> Callable[[list[Value]], T]:
    """Return a function that selects by the type of PID, the first argument."""
    made = {kind: make(kind) for kind in PidType}
    return lambda words: made[PID_TYPE.read(words[at : at + 1])[0]](words)


def _found_of_axes(topic: Topic, method: Callable[..., Any], at: int) -> Answer:
    """Return the function that computes the data of a method with any selection of axes."""
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

#: The number of arguments that select axes.
_SELECTION = {Shape.ALL: 0, Shape.ONE: 1, Shape.GROUP: 2}


def _joint(words: list[Value], at: int) -> int:
    return whole(words[at] if len(words) > at else None)


def _listed(words: list[Value], at: int) -> Bottle:
    """Return the list of values, the last of the arguments."""
    return inner(words[at] if len(words) == at + 1 else None)


def _group(words: list[Value], at: int) -> list[int]:
    joints = inner(words[at + 1] if len(words) > at + 1 else None, _joint(words, at))
    return [whole(joint) for joint in joints]


def _selecting(shape: Shape) -> Callable[[list[Value], int], int | list[int] | None]:
    """Return the function that reads the selection of axes from a request."""
    if shape is Shape.ALL:
        return lambda _words, _at: None
    return _joint if shape is Shape.ONE else _group


def _echoed(echo: Echo, topic: Topic) -> slice:
    """Return the words of a request that its answer repeats."""
    if echo is Echo.TOPIC:
        return slice(1, 2)
    if echo is Echo.METHOD:
        return slice(3, 4) if topic.shape is Shape.ONE else slice(2, 3)
    return slice(0)
