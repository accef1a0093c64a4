"""Values that travel alone: a string, bytes, a property."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, BottleError, Dialect, Property, as_bytes
from rtf.bottle.binary import LARGE_BLOB, decode_from, encode_blocks
from rtf.bottle.tags import LIST, int32, pair
from rtf.bottle.values import Kind
from rtf.middleware.codecs import TextCodec

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.carriers.base import Buffer


class StringCodec(TextCodec[str]):
    """One string: a bottle of it alone."""

    def encode(self, value: str, dialect: Dialect) -> Sequence[Buffer]:
        """One block."""
        return encode_blocks(Bottle([value]), dialect)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[str, int]:
        """The only string; anything else is given as its text, so that every message can be read as a string."""
        bottle, end = decode_from(data, 0, dialect)
        first = bottle[0] if len(bottle) == 1 else None
        return first if isinstance(first, str) else bottle.to_text(), end


class BytesCodec(TextCodec[bytes]):
    """One blob: a bottle of it alone. What is sent may be any flat buffer; large ones are not copied."""

    def encode(self, value: Buffer, dialect: Dialect) -> Sequence[Buffer]:  # noqa: ARG002 - the same in both
        """The head, and the blob as it is, unless it is small."""
        view = memoryview(value).cast("B")
        head = pair.pack(LIST | Kind.BLOB, 1) + int32.pack(len(view))
        return (head, view) if len(view) >= LARGE_BLOB else (head + view,)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[bytes, int]:
        """The only blob."""
        bottle, end = decode_from(data, 0, dialect)
        blob = as_bytes(bottle[0]) if len(bottle) == 1 else None
        if blob is None:
            raise BottleError(f"bytes were expected, {bottle.to_text()[:60]!r} came")
        return blob, end


class PropertyCodec(TextCodec[Property]):
    """A property: the bottle of its groups. A dictionary is sent as one, and dictionaries in it as properties."""

    def encode(self, value: Property | Mapping[str, object], dialect: Dialect) -> Sequence[Buffer]:
        """One block."""
        return encode_blocks(value if isinstance(value, Property) else property_of(value), dialect)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[Property, int]:
        """The groups; what stands outside of lists is passed over."""
        bottle, end = decode_from(data, 0, dialect)
        return Property.from_bottle(bottle), end


def property_of(values: Mapping[str, object]) -> Property:
    """A property of a dictionary: a list is one value, a dictionary inside becomes a property."""
    return Property({key: property_of(value) if isinstance(value, Mapping) else value for key, value in values.items()})


STRING = StringCodec()
BYTES = BytesCodec()
PROPERTY = PropertyCodec()
