"""What a function of a device answers besides its results: whether it worked, and if not, why."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, BottleError, Dialect, Vocab
from rtf.bottle.binary import LIST, TruncatedBottleError, decode_from, encode_element
from rtf.bottle.tags import pair
from rtf.bottle.values import Kind
from rtf.middleware.codecs import TextCodec

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Value
    from rtf.middleware.carriers.base import Buffer


class ReturnValue(Enum):
    """How a call ended: the word that says so in YARP 4.0, and the number in 3.11 and 3.12."""

    OK = ("ok", 0)
    GENERIC = ("err1", 1)
    NOT_IMPLEMENTED = ("err2", 2)
    COMMUNICATION = ("err3", 3)
    DEPRECATED = ("err4", 4)
    METHOD_FAILED = ("err5", 5)
    NOT_READY = ("err6", 6)
    UNINITIALIZED = ("miss", 100)

    def __init__(self, word: str, number: int) -> None:
        self.word = word
        self.number = number

    @classmethod
    def of(cls, value: Value | None) -> ReturnValue:
        """The one that an answer's element means; of errors that are not known here the generic one.

        Raises BottleError for an element that is none.
        """
        if isinstance(value, Bottle) and len(value) == 1:
            value = value[0]
        if isinstance(value, Vocab):
            return _BY_WORD.get(value, cls.GENERIC)
        if isinstance(value, int):
            return _BY_NUMBER.get(value, cls.GENERIC)
        raise BottleError(f"an answer begins with whether it worked, not with {value!r}")

    @property
    def codec(self) -> ReturnValueCodec:
        """How it is written."""
        return RETURN_VALUE


class ReturnValueCodec(TextCodec[ReturnValue]):
    """In 4.0 a list of one word, in 3.x an element that has no list around it."""

    def encode(self, value: ReturnValue, dialect: Dialect) -> Sequence[Buffer]:
        """One block."""
        if dialect is Dialect.YARP3:
            return (pair.pack(Kind.INT32, value.number),)
        return (pair.pack(LIST, 1) + encode_element(Vocab(value.word), dialect),)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[ReturnValue, int]:
        if dialect is Dialect.YARP4:
            bottle, end = decode_from(data, 0, dialect)
            return ReturnValue.of(bottle), end
        if len(data) < pair.size:
            raise TruncatedBottleError(pair.size)
        code, number = pair.unpack_from(data)
        if code != Kind.INT32:
            raise BottleError(f"whether it worked is told by a number, not by something of code {code}")
        return ReturnValue.of(number), pair.size

    def to_text(self, value: ReturnValue) -> str:
        """The word, as a tool for 4.0 shows it."""
        return Bottle([Vocab(value.word)]).to_text()

    def from_text(self, text: str) -> ReturnValue:
        """The word that was typed."""
        return ReturnValue.of(Bottle.parse(text))


RETURN_VALUE = ReturnValueCodec()
_BY_WORD = {Vocab(one.word): one for one in ReturnValue}
_BY_NUMBER = {one.number: one for one in ReturnValue}
