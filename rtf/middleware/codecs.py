"""Codecs: how an object becomes the bytes of a message, and the other way round.

Everything that YARP's programs exchange is, byte for byte, a bottle, so anything can be shown and typed as one. A
codec makes the same bytes without going through one. The types of this package have theirs in ``rtf.middleware.types``;
nothing of it is loaded before an object or its owner asks for it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from rtf.bottle import Bottle, BottleSyntaxError, Dialect, Property
from rtf.bottle.binary import Scanner, TruncatedBottleError, decode_from, encode, encode_blocks, extent
from rtf.middleware.errors import ProtocolError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.carriers.base import Buffer

T = TypeVar("T")


class Codec(Protocol[T]):
    """Writes and reads one type of object. ``promise`` is the name under which ports announce it: ``yarp/image``."""

    promise: str

    def encode(self, value: T, dialect: Dialect) -> Sequence[Buffer]:
        """The bytes of an object, in blocks that need not be copied together. Large ones may be its own memory."""

    def decode(self, data: Buffer, dialect: Dialect) -> T:
        """The object in a message. Its own memory: ``data`` is used again. Raises a RtfError for what is none."""

    def adopt(self, data: Buffer, dialect: Dialect) -> T:
        """The same from bytes that nobody else will use or change: the object may keep them instead of a copy."""

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[T, int]:
        """The object that bytes begin with, in its own memory, and where it ends: for replies, which have no frame.

        Raises TruncatedBottleError, too, when more bytes are needed.
        """

    def to_text(self, value: T) -> str:
        """The object as a person would type it."""

    def from_text(self, text: str) -> T:
        """The object that was typed. Raises a RtfError for what is none."""


class TextCodec(ABC, Generic[T]):
    """Base of codecs whose text is that of the bottle that the bytes are, and whose bytes tell where they end."""

    promise = ""

    @abstractmethod
    def encode(self, value: T, dialect: Dialect) -> Sequence[Buffer]:
        """See Codec."""

    @abstractmethod
    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[T, int]:
        """See Codec."""

    def decode(self, data: Buffer, dialect: Dialect) -> T:
        """The object that the message begins with; what follows it is passed over, as YARP does."""
        return self.decode_from(data, dialect)[0]

    def adopt(self, data: Buffer, dialect: Dialect) -> T:
        """As ``decode``, unless a codec has something to gain."""
        return self.decode(data, dialect)

    def to_text(self, value: T) -> str:
        """The object as a person would type it."""
        return decode_from(b"".join(self.encode(value, Dialect.YARP3)))[0].to_text()

    def from_text(self, text: str) -> T:
        """The object that was typed."""
        return self.decode(encode(Bottle.parse(text)), Dialect.YARP3)


class BottleCodec(TextCodec[Bottle]):
    """Bottles; a property is written as one."""

    def encode(self, value: Bottle | Property, dialect: Dialect) -> Sequence[Buffer]:
        """One block, and one more for each large blob."""
        return encode_blocks(value, dialect)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[Bottle, int]:
        return decode_from(data, 0, dialect)

    def decode(self, data: Buffer, dialect: Dialect) -> Bottle:
        """The bottle that the message begins with."""
        return decode_from(data, 0, dialect)[0]

    def to_text(self, value: Bottle | Property) -> str:
        """The text form."""
        return value.to_text()

    def from_text(self, text: str) -> Bottle:
        """The text form, read as YARP reads it."""
        return Bottle.parse(text)


BOTTLE = BottleCodec()


class RawCodec(TextCodec[bytes]):
    """Bytes as they are: for those who pass messages on, and for tests."""

    def encode(self, value: bytes, dialect: Dialect) -> Sequence[Buffer]:  # noqa: ARG002 - bytes have no dialect
        """One block."""
        return (value,)

    def decode(self, data: Buffer, dialect: Dialect) -> bytes:  # noqa: ARG002
        """A copy of everything."""
        return bytes(data)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[bytes, int]:
        """A copy of the bottle that the bytes begin with."""
        end = extent(data, 0, dialect)
        return bytes(data[:end]), end


RAW = RawCodec()


class Arriving(Generic[T]):
    """Reads one object out of bytes that are still arriving: a reply, or a message of a carrier without frames.

    Usually everything is there at once. If not, the rest is awaited without reading anything twice, so a peer that
    sends byte by byte costs no more than another one::

        arriving = Arriving(codec, dialect)
        while True:
            try:
                value, end = arriving.read(stream.window())
                break
            except TruncatedBottleError as error:
                stream.peek(error.needed)  # after comparing it with what may be kept
    """

    __slots__ = ("_codec", "_dialect", "_scanner", "_tried")

    def __init__(self, codec: Codec[T], dialect: Dialect) -> None:
        self._codec = codec
        self._dialect = dialect
        self._scanner: Scanner | None = Scanner(dialect)
        self._tried = False

    def read(self, data: Buffer) -> tuple[T, int]:
        """The object and where it ends; ``data`` are all bytes that are there. Errors as for ``decode_from``."""
        if self._tried and self._scanner is not None:
            try:
                self._scanner.end(data)
            except TruncatedBottleError:
                raise
            except BottleSyntaxError:  # some answers of services are no bottles; their codecs know how long they are
                self._scanner = None
        self._tried = True
        return self._codec.decode_from(data, self._dialect)


_KNOWN: dict[type, Codec[Any]] = {Bottle: BOTTLE, Property: BOTTLE}
#: The codecs of types that cannot carry theirs: module and name in ``rtf.middleware.types``.
_HOMES: tuple[tuple[Any, str, str], ...] = (
    (str, "plain", "STRING"),
    ((bytes, bytearray, memoryview), "plain", "BYTES"),
    (Mapping, "plain", "PROPERTY"),
)


def other_dialect(dialect: Dialect) -> Dialect:
    """The one of the two that this is not."""
    return Dialect.YARP4 if dialect is Dialect.YARP3 else Dialect.YARP3


def codec_of(value: object) -> Codec[Any]:  # of whatever type the value has
    """The codec for an object that is given to a port without saying which. Raises ProtocolError."""
    known = _KNOWN.get(type(value))
    if known is not None:
        return known
    if type(value).__name__ == "ndarray":
        return import_module("rtf.middleware.types.arrays").codec_of_array(value)  # type: ignore[no-any-return]
    codec = getattr(value, "codec", None)  # the types of ours carry theirs
    if codec is not None:
        return codec  # type: ignore[no-any-return]
    for types, module, name in _HOMES:
        if isinstance(value, types):
            return getattr(import_module(f"rtf.middleware.types.{module}"), name)  # type: ignore[no-any-return]
    raise ProtocolError(f"no way is known to send a {type(value).__name__}; give a codec, or a Bottle of its values")
