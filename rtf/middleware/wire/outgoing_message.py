"""A message to be sent: the object, and its encoded forms, each made when a carrier first needs it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Dialect
    from rtf.middleware.types.codecs import Buffer, Codec

#: Blocks with at most this many bytes in total are joined and sent in one call.
JOINED = 1 << 12


class OutgoingMessage:
    """A message to any number of readers. ``key`` is the port command: ``D``, or ``d`` if a reply is wanted.

    ``envelope`` is the text that travels beside the object. The object must not change until all outputs have sent it.
    """

    __slots__ = ("_blocks", "_frozen", "_other", "_size", "_text", "codec", "dialect", "envelope", "key", "value")

    def __init__(self, key: str, value: object, codec: Codec[Any], dialect: Dialect, envelope: str = "") -> None:
        self.key = key
        self.value = value
        self.codec = codec
        self.dialect = dialect
        self.envelope = envelope
        self._blocks: Sequence[Buffer] | None = None
        self._size = 0
        self._frozen = False
        self._text: str | None = None
        self._other: OutgoingMessage | None = None

    @property
    def blocks(self) -> Sequence[Buffer]:
        """The encoded object, in blocks."""
        blocks = self._blocks
        if blocks is None:
            blocks = self.codec.encode(self.value, self.dialect)
            self._size = len(blocks[0]) if len(blocks) == 1 else sum(map(len, blocks))
            self._blocks = blocks  # last: the page of the port may ask for the size in another thread
        return blocks

    def freeze(self) -> None:
        """Encode the object now, into memory of its own. Later changes of the object do not change bytes or text."""
        self._frozen = True
        self._blocks = (b"".join(self.codec.encode(self.value, self.dialect)),)
        self._size = len(self._blocks[0])

    def in_dialect(self, dialect: Dialect) -> OutgoingMessage:
        """Return the message for a reader of a dialect; it is encoded once for all of them. Any thread."""
        if dialect is self.dialect:
            return self
        other = self._other
        if other is None:
            value = self.codec.decode(self.blocks[0], self.dialect) if self._frozen else self.value
            other = OutgoingMessage(self.key, value, self.codec, dialect, self.envelope)
            if self._frozen:
                other.freeze()
            self._other = other
        return other

    @property
    def size(self) -> int:
        """The number of encoded bytes."""
        if self._blocks is None:
            self.blocks  # noqa: B018 - makes them
        return self._size

    @property
    def text(self) -> str:
        """The text form of the object, on one line."""
        if self._text is None:
            value = self.codec.decode(self.blocks[0], self.dialect) if self._frozen else self.value
            self._text = self.codec.to_text(value)
        return self._text
