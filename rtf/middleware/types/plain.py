"""Codecs of single values: a string, bytes, a property."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, BottleError, Dialect, Property, as_bytes
from rtf.bottle.binary import LARGE_BLOB, decode_from, encode_blocks
from rtf.bottle.tags import LIST, int32, pair
from rtf.bottle.values import Kind
from rtf.middleware.types.codecs import TextCodec

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.types.codecs import Buffer


class StringCodec(TextCodec[str]):
    """Codec of a string, which is encoded as a bottle with one element."""

    def encode(self, value: str, dialect: Dialect) -> Sequence[Buffer]:
        """One block."""
        return encode_blocks(Bottle([value]), dialect)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[str, int]:
        """Decode the only string. Any other message is returned as its text: all messages can be read as strings."""
        bottle, end = decode_from(data, 0, dialect)
        first = bottle[0] if len(bottle) == 1 else None
        return first if isinstance(first, str) else bottle.to_text(), end


class BytesCodec(TextCodec[bytes]):
    """Codec of bytes: a bottle with one blob. Any flat buffer can be encoded; a large one is not copied."""

    def encode(self, value: Buffer, dialect: Dialect) -> Sequence[Buffer]:  # noqa: ARG002 - the same in both
        """Return the header and the blob, joined if the blob is small."""
        view = memoryview(value).cast("B")
        head = pair.pack(LIST | Kind.BLOB, 1) + int32.pack(len(view))
        return (head, view) if len(view) >= LARGE_BLOB else (head + view,)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[bytes, int]:
        """Decode the only blob."""
        bottle, end = decode_from(data, 0, dialect)
        blob = as_bytes(bottle[0]) if len(bottle) == 1 else None
        if blob is None:
            raise BottleError(f"expected bytes, got {bottle.to_text()[:60]!r}")
        return blob, end


class PropertyCodec(TextCodec[Property]):
    """Codec of properties: the bottle of the groups. A dictionary is encoded as a property, and so are those in it."""

    def encode(self, value: Property | Mapping[str, object], dialect: Dialect) -> Sequence[Buffer]:
        """One block."""
        return encode_blocks(value if isinstance(value, Property) else property_of(value), dialect)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[Property, int]:
        """Decode the groups; elements outside of lists are ignored."""
        bottle, end = decode_from(data, 0, dialect)
        return Property.from_bottle(bottle), end


def property_of(values: Mapping[str, object]) -> Property:
    """Convert a dictionary to a property: a list becomes one value, an inner dictionary a property."""
    return Property({key: property_of(value) if isinstance(value, Mapping) else value for key, value in values.items()})


STRING = StringCodec()
BYTES = BytesCodec()
PROPERTY = PropertyCodec()
