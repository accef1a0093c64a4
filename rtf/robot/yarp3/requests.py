"""The requests of a client, by the device method that they implement; generated from the vocabulary table."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from rtf.bottle import Bottle, Value, Vocab
from rtf.bottle.binary import LIST, encode
from rtf.bottle.tags import TAGS, pair
from rtf.bottle.values import INT32_MAX, INT32_MIN
from rtf.bottle.values import Kind as Type
from rtf.middleware.types.codecs import BottleCodec
from rtf.robot.yarp3 import table as vocabulary
from rtf.robot.yarp3 import values as kinds
from rtf.robot.yarp3.table import GET, SET, Echo, Shape

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from rtf.bottle import Dialect, Property
    from rtf.middleware.types.codecs import Buffer
    from rtf.robot.yarp3.table import Topic
    from rtf.robot.yarp3.values import Kind

#: The number of elements before the data of an answer.
_HEADS = {Echo.TOPIC: 2, Echo.METHOD: 2, Echo.BARE_IS: 1, Echo.NOTHING: 0}
#: ``[ok]``, and before it ``[tsta]``, a count and the time.
_TAIL, _STAMPED_TAIL = 1, 4


class Request(NamedTuple):
    """A request, and the position of the data in its answer: after ``head`` elements, before the last ``tail``.

    ``alone`` is the message without arguments, ``front`` the bytes before the arguments, after their number. Both are
    the same in both dialects.
    """

    words: tuple[Value, ...]
    alone: bytes
    front: bytes
    kind: Kind
    head: int = 0
    tail: int = _TAIL


def _made(words: Iterable[Value], kind: Kind, head: int = 0, tail: int = _TAIL) -> Request:
    elements = [*words]
    alone, with_one = encode(Bottle.adopt(elements)), encode(Bottle.adopt([*elements, 0]))
    return Request((*elements,), alone, with_one[pair.size : -pair.size], kind, head, tail)


#: A request and its arguments.
FilledRequest: TypeAlias = tuple[Request, tuple[Value, ...]]


class RequestCodec(BottleCodec):
    """Codec that encodes a request from its parts, as the bottle that they form; it decodes plain bottles.

    The words are encoded once, and numbers, which most arguments are, directly. Building a bottle first takes ten times
    as long.
    """

    def encode(self, value: Bottle | Property | FilledRequest, dialect: Dialect) -> Sequence[Buffer]:
        if not isinstance(value, tuple):
            return super().encode(value, dialect)
        request, arguments = value
        if not arguments:
            return (request.alone,)
        parts = [_pack_pair(LIST, len(request.words) + len(arguments)), request.front]
        for argument in arguments:
            if type(argument) is int and INT32_MIN <= argument <= INT32_MAX:
                parts.append(_pack_pair(_INT32, argument))
            elif type(argument) is float:
                parts.append(_pack_double(TAGS[dialect].float64_code, argument))
            else:
                return super().encode(plain(value), dialect)
        return (b"".join(parts),)

    def to_text(self, value: Bottle | Property | FilledRequest) -> str:
        return super().to_text(plain(value) if isinstance(value, tuple) else value)


REQUEST = RequestCodec()
_pack_pair, _pack_double, _INT32 = pair.pack, struct.Struct("<id").pack, Type.INT32.value


def plain(asked: FilledRequest) -> Bottle:
    """Return a request as a bottle."""
    request, arguments = asked
    return Bottle.adopt([*request.words, *arguments])


#: The requests of a method, by the shape of their axes.
RequestsByShape = dict[Shape, Request]


def _request(topic: Topic, verb: Vocab) -> Request:
    family = topic.family
    kind = topic.given if verb == SET and topic.given is not None else topic.kind
    tail = _STAMPED_TAIL if family.stamped else _TAIL
    return _made((verb, *map(Vocab, topic.words)), kind, _HEADS[family.echo], tail)


def _by_method() -> tuple[dict[str, RequestsByShape], dict[str, RequestsByShape]]:
    """Return the requests that read and those that write."""
    getting: dict[str, RequestsByShape] = {}
    setting: dict[str, RequestsByShape] = {}
    for topic in vocabulary.TOPICS.values():
        if topic.fixed:
            continue  # a shorthand of another topic
        if topic.get:
            getting.setdefault(topic.get, {}).setdefault(topic.shape, _request(topic, GET))
        if topic.set:
            setting.setdefault(topic.set, {}).setdefault(topic.shape, _request(topic, SET))
    return getting, setting


GETTING: Mapping[str, RequestsByShape]
SETTING: Mapping[str, RequestsByShape]
GETTING, SETTING = _by_method()

# Requests outside of the table.
PROTOCOL = _made((GET, Vocab("prot")), kinds.INT)
CALIBRATE = _made((Vocab("calj"),), kinds.CALIBRATION)
KEEP_CALIBRATION = _made((Vocab("cljp"),), kinds.CALIBRATION)
CALIBRATION_DONE = _made((Vocab("cald"),), kinds.NOTHING)
