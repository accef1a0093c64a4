"""A message on its way out: the object, and what carriers make of it, made when the first of them asks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Dialect
    from rtf.middleware.carriers.base import Buffer
    from rtf.middleware.codecs import Codec


class Outgoing:
    """One object that goes to any number of readers. ``key`` is the command: ``D``, or ``d`` when a reply is wanted.

    ``envelope`` is the text beside it. The object must not change until all have got it.
    """

    __slots__ = ("_blocks", "_frozen", "_size", "_text", "codec", "dialect", "envelope", "key", "value")

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

    @property
    def blocks(self) -> Sequence[Buffer]:
        """Its bytes."""
        blocks = self._blocks
        if blocks is None:
            blocks = self._blocks = self.codec.encode(self.value, self.dialect)
            self._size = len(blocks[0]) if len(blocks) == 1 else sum(map(len, blocks))
        return blocks

    def freeze(self) -> None:
        """Make its bytes now, in memory of their own: what the object is later has no effect on them and the text."""
        self._frozen = True
        self._blocks = (b"".join(self.codec.encode(self.value, self.dialect)),)
        self._size = len(self._blocks[0])

    @property
    def size(self) -> int:
        """The number of its bytes."""
        if self._blocks is None:
            self.blocks  # noqa: B018 - makes them
        return self._size

    @property
    def text(self) -> str:
        """Its text form, on one line."""
        if self._text is None:
            value = self.codec.decode(self.blocks[0], self.dialect) if self._frozen else self.value
            self._text = self.codec.to_text(value)
        return self._text
