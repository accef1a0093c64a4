"""The errors of values: one base class and three subclasses, with the offset in the text if there is one."""

from __future__ import annotations

from rtf.errors import RtfError


class BottleError(RtfError, ValueError):
    """An invalid value or text; ``offset`` counts characters from 0, -1 means that there is no text."""

    def __init__(self, message: str, offset: int = -1) -> None:
        super().__init__(message if offset < 0 else f"{message} (column {offset + 1})")
        self.offset = offset


class BottleSyntaxError(BottleError):
    """Text that a strict parser refuses: a quote, list or blob that is not closed, or closed without being opened."""


class BottleLimitError(BottleError):
    """Text or a bottle beyond the limits of size, depth or work, which prevent that input exhausts the process."""


class BottleTypeError(BottleError, TypeError):
    """A Python object that no bottle can hold."""
