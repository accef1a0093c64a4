"""The protocol version, which clients of services request before anything else."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from rtf.bottle import Bottle, BottleError, Dialect
from rtf.bottle.binary import LIST, TruncatedBottleError
from rtf.middleware.types.codecs import TextCodec

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.types.codecs import Buffer

_VERSION = struct.Struct("<2i4h")
_NUMBERS = 4


class ProtocolVersionCodec(TextCodec["ProtocolVersion"]):
    """Codec of protocol versions: the header of a list of one, and four plain 16-bit numbers; not a valid bottle."""

    def encode(self, value: ProtocolVersion, dialect: Dialect) -> Sequence[Buffer]:  # noqa: ARG002 - the same in both
        """One block."""
        return (_VERSION.pack(LIST, 1, value.protocol, value.major, value.minor, value.patch),)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[ProtocolVersion, int]:  # noqa: ARG002
        if len(data) < _VERSION.size:
            raise TruncatedBottleError(_VERSION.size)
        kind, count, *numbers = _VERSION.unpack_from(data)
        if (kind, count) != (LIST, 1):
            raise BottleError(f"this is not a protocol version: {bytes(data[: _VERSION.size])!r}")
        return ProtocolVersion(*numbers), _VERSION.size

    def to_text(self, value: ProtocolVersion) -> str:
        """The four numbers."""
        return f"{value.protocol} {value.major} {value.minor} {value.patch}"

    def from_text(self, text: str) -> ProtocolVersion:
        """The four numbers."""
        numbers = [value for value in Bottle.parse(text) if isinstance(value, int)]
        if len(numbers) != _NUMBERS or not all(-(1 << 15) <= number < 1 << 15 for number in numbers):
            raise BottleError(f"a protocol version is four 16-bit numbers, not {text[:60]!r}")
        return ProtocolVersion(*numbers)


@dataclass(frozen=True, slots=True)
class ProtocolVersion:
    """The answer of services to ``getRemoteProtocolVersion``: the protocol number and the release."""

    protocol: int
    major: int
    minor: int
    patch: int
    codec: ClassVar[ProtocolVersionCodec] = ProtocolVersionCodec()
