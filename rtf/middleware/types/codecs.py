"""Codecs: the conversion between an object and the bytes of a message.

Every message of YARP is, byte for byte, a bottle, so it can be printed and typed as one. A codec produces the same
bytes without building the bottle. The codecs of the types in ``rtf.middleware.types`` are in that package, and each is
imported on first use.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeAlias, TypeVar

from rtf.bottle import Bottle, Dialect, Property
from rtf.bottle.binary import decode_from, encode, encode_blocks, extent
from rtf.middleware.errors import ProtocolError

if TYPE_CHECKING:
    from collections.abc import Sequence

T = TypeVar("T")
#: Bytes of a message.
Buffer: TypeAlias = "bytes | bytearray | memoryview"


class Codec(Protocol[T]):
    """Encodes and decodes one type of object. ``promise`` is the type name that ports announce: ``yarp/image``."""

    promise: str

    def encode(self, value: T, dialect: Dialect) -> Sequence[Buffer]:
        """Return the bytes of an object as a sequence of blocks. A large block may be the object's own memory."""

    def decode(self, data: Buffer, dialect: Dialect) -> T:
        """Decode a message into memory of its own: ``data`` is reused. Raises an RtfError if it cannot be decoded."""

    def adopt(self, data: Buffer, dialect: Dialect) -> T:
        """Decode a message whose bytes nothing else uses or changes: the object may keep them instead of a copy."""

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[T, int]:
        """Decode the object at the start of ``data`` into memory of its own; return it and its end offset.

        Used for replies, which have no length prefix.

        Raises TruncatedBottleError if more bytes are needed.
        """

    def to_text(self, value: T) -> str:
        """The object as a person would type it."""

    def from_text(self, text: str) -> T:
        """Parse an object from its text form. Raises an RtfError if the text is invalid."""


class TextCodec(ABC, Generic[T]):
    """Base class of codecs whose text form is that of a bottle, and whose bytes are self-delimiting."""

    promise = ""

    @abstractmethod
    def encode(self, value: T, dialect: Dialect) -> Sequence[Buffer]:
        """Encode an object as blocks of bytes."""

    @abstractmethod
    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[T, int]:
        """Decode an object; return it with the position after its bytes."""

    def decode(self, data: Buffer, dialect: Dialect) -> T:
        """Decode the object at the start of the message and ignore what follows it, as YARP does."""
        return self.decode_from(data, dialect)[0]

    def adopt(self, data: Buffer, dialect: Dialect) -> T:
        """Same as ``decode``. Overridden by codecs that can avoid a copy."""
        return self.decode(data, dialect)

    def to_text(self, value: T) -> str:
        """The object as a person would type it."""
        return decode_from(b"".join(self.encode(value, Dialect.YARP3)))[0].to_text()

    def from_text(self, text: str) -> T:
        """The object that was typed."""
        return self.decode(encode(Bottle.parse(text)), Dialect.YARP3)


class BottleCodec(TextCodec[Bottle]):
    """Codec of bottles. A property is encoded as a bottle."""

    def encode(self, value: Bottle | Property, dialect: Dialect) -> Sequence[Buffer]:
        """Return one block, and one more for each large blob."""
        return encode_blocks(value, dialect)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[Bottle, int]:
        return decode_from(data, 0, dialect)

    def decode(self, data: Buffer, dialect: Dialect) -> Bottle:
        """Decode the bottle at the start of the message."""
        return decode_from(data, 0, dialect)[0]

    def to_text(self, value: Bottle | Property) -> str:
        """The text form."""
        return value.to_text()

    def from_text(self, text: str) -> Bottle:
        """Parse the text form by YARP's rules."""
        return Bottle.parse(text)


BOTTLE = BottleCodec()


class RawCodec(TextCodec[bytes]):
    """Codec that does no conversion: for programs that forward messages, and for tests."""

    def encode(self, value: bytes, dialect: Dialect) -> Sequence[Buffer]:  # noqa: ARG002 - bytes have no dialect
        """One block."""
        return (value,)

    def decode(self, data: Buffer, dialect: Dialect) -> bytes:  # noqa: ARG002
        """Return a copy of the whole message."""
        return bytes(data)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[bytes, int]:
        """Return a copy of the bottle at the start of the bytes."""
        end = extent(data, 0, dialect)
        return bytes(data[:end]), end


RAW = RawCodec()


_KNOWN: dict[type, Codec[Any]] = {Bottle: BOTTLE, Property: BOTTLE}
#: The codecs of built-in types: module and name in ``rtf.middleware.types``.
_HOMES: tuple[tuple[Any, str, str], ...] = (
    (str, "plain", "STRING"),
    ((bytes, bytearray, memoryview), "plain", "BYTES"),
    (Mapping, "plain", "PROPERTY"),
)


def other_dialect(dialect: Dialect) -> Dialect:
    """Return the other of the two dialects."""
    return Dialect.YARP4 if dialect is Dialect.YARP3 else Dialect.YARP3


def codec_of(value: object) -> Codec[Any]:  # Any: the type of the value
    """Return the codec for a value that was given to a port without a codec. Raises ProtocolError."""
    known = _KNOWN.get(type(value))
    if known is not None:
        return known
    if type(value).__name__ == "ndarray":
        return import_module("rtf.middleware.types.matrix").codec_of_array(value)  # type: ignore[no-any-return]
    codec = getattr(value, "codec", None)  # the types of this package have a codec attribute
    if codec is not None:
        return codec  # type: ignore[no-any-return]
    for types, module, name in _HOMES:
        if isinstance(value, types):
            return getattr(import_module(f"rtf.middleware.types.{module}"), name)  # type: ignore[no-any-return]
    raise ProtocolError(f"no codec for the type {type(value).__name__}; pass a codec, or a Bottle of its values")
