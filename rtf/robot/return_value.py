"""The return value of a service function: success, or the kind of error."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, BottleError, Dialect, Vocab
from rtf.bottle.binary import LIST, TruncatedBottleError, decode_from, encode_element
from rtf.bottle.tags import pair
from rtf.bottle.values import Kind
from rtf.middleware.types.codecs import TextCodec

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Value
    from rtf.middleware.types.codecs import Buffer


class ReturnValue(Enum):
    """The result of a call: its word in YARP 4.0, and its number in 3.11 and 3.12."""

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
        """Decode an element of an answer; unknown errors become the generic one.

        Raises BottleError for an element of another type.
        """
        if isinstance(value, Bottle) and len(value) == 1:
            value = value[0]
        if isinstance(value, Vocab):
            return _BY_WORD.get(value, cls.GENERIC)
        if isinstance(value, int):
            return _BY_NUMBER.get(value, cls.GENERIC)
        raise BottleError(f"an answer begins with a return value, not with {value!r}")

    @property
    def codec(self) -> ReturnValueCodec:
        """The codec of return values."""
        return RETURN_VALUE


class ReturnValueCodec(TextCodec[ReturnValue]):
    """Codec of return values: in YARP 4.0 a list of one word, in 3.x a number without a list."""

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
            raise BottleError(f"a return value is a number, not an element of code {code}")
        return ReturnValue.of(number), pair.size

    def to_text(self, value: ReturnValue) -> str:
        """Return the word, as a tool for YARP 4.0 shows it."""
        return Bottle([Vocab(value.word)]).to_text()

    def from_text(self, text: str) -> ReturnValue:
        """Parse the word."""
        return ReturnValue.of(Bottle.parse(text))


RETURN_VALUE = ReturnValueCodec()
_BY_WORD = {Vocab(one.word): one for one in ReturnValue}
_BY_NUMBER = {one.number: one for one in ReturnValue}
