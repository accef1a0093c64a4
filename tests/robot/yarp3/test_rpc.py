"""The codec of requests: the bytes that it writes from parts are those of the whole bottle."""

from __future__ import annotations

import pytest

from rtf.bottle import Bottle, Dialect, Int64, Value, Vocab
from rtf.bottle.binary import decode, encode
from rtf.robot.yarp3.requests import CALIBRATION_DONE, GETTING, PROTOCOL, REQUEST, SETTING, Request
from rtf.robot.yarp3.table import FAIL, GET, IS, NAK, OK, PROTOCOL_VERSION, SET, STAMP

QUESTIONS = [
    PROTOCOL,
    CALIBRATION_DONE,
    *(question for table in (GETTING, SETTING) for shapes in table.values() for question in shapes.values()),
]
ARGUMENTS: list[tuple[Value, ...]] = [
    (),
    (3,),
    (-3,),
    (3, 2.5),
    (3, 2.5, -0.5),
    (2.5,),
    (1 << 40,),
    (3, Int64(3)),
    (Vocab("pos"),),
    (Vocab("pos"), 3),
    (2, Bottle([0, 1]), Bottle([2.5, 3.5])),
    ("key", 1),
]


@pytest.mark.parametrize("dialect", Dialect)
@pytest.mark.parametrize("arguments", ARGUMENTS, ids=str)
def test_bytes_are_those_of_the_bottle(arguments: tuple[Value, ...], dialect: Dialect):
    """A request that is encoded from parts has the bytes of the whole bottle, with any arguments."""
    for question in QUESTIONS:
        whole = Bottle([*question.words, *arguments])
        asked = question, arguments
        assert b"".join(REQUEST.encode(asked, dialect)) == encode(whole, dialect), question.words
        assert REQUEST.to_text(asked) == whole.to_text()
        assert REQUEST.decode(encode(whole, dialect), dialect) == whole


def test_a_bottle_is_written_as_one():
    """The codec encodes plain bottles, too."""
    bottle = Bottle.parse("[get] [pos] 3")
    assert REQUEST.encode(bottle, Dialect.YARP3) == [encode(bottle)]
    assert REQUEST.to_text(bottle) == "[get] [pos] 3"


@pytest.mark.parametrize("word", [GET, SET, IS, OK, FAIL, NAK, STAMP, PROTOCOL_VERSION], ids=str)
def test_words_are_read_into_the_same_objects(word: Vocab):
    """Decoded words are shared objects, so that an identity check is enough in the usual case."""
    assert decode(encode(Bottle([word, 1])))[0] is word


def test_words_of_the_questions_are_those_of_the_table():
    """The words of the request for ``motion_done`` are those of the table."""
    (question, *_) = GETTING["motion_done"].values()
    assert isinstance(question, Request)
    assert Bottle([*question.words]).to_text() == "[get] [don]"
