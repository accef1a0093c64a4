"""What can go wrong with values: one base error and three leaves, with the offset in the text if any."""

from __future__ import annotations

from rtf.errors import RtfError


class BottleError(RtfError, ValueError):
    """A value or a text that cannot be one; ``offset`` counts characters from 0, -1 stands for no text."""

    def __init__(self, message: str, offset: int = -1) -> None:
        super().__init__(message if offset < 0 else f"{message} (column {offset + 1})")
        self.offset = offset


class BottleSyntaxError(BottleError):
    """Text that a strict reader refuses: a quote, list or blob that is not closed, or closed without being opened."""


class BottleLimitError(BottleError):
    """Text or a bottle beyond the bounds of size, depth or work; with them no input can hang or exhaust us."""


class BottleTypeError(BottleError, TypeError):
    """A Python object that no bottle can hold."""
