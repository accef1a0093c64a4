"""YARP's pixel formats: the word for each, the type of its channels, and their number."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.bottle import BottleError, BottleTypeError, Vocab

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: The largest pixel of an unknown format, in bytes; the largest known ones have twelve.
_MAX_DEPTH = 64


@dataclass(frozen=True, slots=True)
class PixelFormat:
    """A pixel format. ``code`` is YARP's word, such as ``rgb``, or a number for a format without a word."""

    code: str | int
    dtype: np.dtype[Any]
    channels: int = 1

    @property
    def depth(self) -> int:
        """The number of bytes per pixel."""
        return self.channels * self.dtype.itemsize

    @property
    def number(self) -> int:
        """The number of the format on the wire."""
        return self.code if isinstance(self.code, int) else Vocab(self.code).value

    def shape(self, height: int, width: int) -> tuple[int, ...]:
        """Return the shape of an array of such pixels."""
        return (height, width) if self.channels == 1 else (height, width, self.channels)


def _formats() -> dict[int, PixelFormat]:
    table: tuple[tuple[str, int, tuple[str, ...]], ...] = (
        ("u1", 1, ("mono", "grbg", "bggr", "gbrg", "rggb", "yuva", "yuvb", "yuvc", "yuvd")),
        ("u2", 1, ("mo16", "gr16", "bg16", "gb16", "rg16")),
        ("u1", 3, ("rgb", "bgr", "hsv")),
        ("u1", 4, ("rgba", "bgra")),
        ("i1", 1, ("sign",)),
        ("i1", 3, ("rgb-",)),
        ("i4", 1, ("int",)),
        ("i4", 3, ("rgbi",)),
        ("f4", 1, ("dec",)),
        ("f4", 3, ("rgb.", "hsv.")),
    )
    formats = [PixelFormat(code, np.dtype(f"<{name}"), parts) for name, parts, codes in table for code in codes]
    return {made.number: made for made in formats}


_FORMATS = _formats()
#: The default format of an array: the first one with its type and number of channels.
_USUAL: dict[tuple[np.dtype[Any], int], PixelFormat] = {}
for _format in _FORMATS.values():
    _USUAL.setdefault((_format.dtype, _format.channels), _format)


def pixel_format(code: str | int, depth: int = 0) -> PixelFormat:
    """Return the pixel format of a word or a number. An unknown one has pixels of ``depth`` bytes.

    A negative number is minus the number of bytes per pixel. Raises BottleError.
    """
    number = code if isinstance(code, int) else Vocab(code).value
    known = _FORMATS.get(number)
    if known is not None:
        return known
    depth = depth if number > 0 else -number
    if not 1 <= depth <= _MAX_DEPTH:
        names = ", ".join(str(known.code) for known in _FORMATS.values())
        raise BottleError(f"pixel code {code!r} is unknown, and {depth} is not a pixel size; known codes: {names}")
    text = Vocab(number).text
    word: str | int = text if number > 0 and Vocab(text).value == number else number
    return PixelFormat(word, np.dtype("u1"), depth)


def usual_format(pixels: NDArray[Any]) -> PixelFormat:
    """Return the default pixel format of an array. Raises BottleTypeError."""
    channels = 1 if pixels.ndim == 2 else pixels.shape[-1]  # noqa: PLR2004 - rows and columns
    found = _USUAL.get((pixels.dtype, channels)) if pixels.ndim in (2, 3) else None
    if found is None:
        raise BottleTypeError(f"an array of {pixels.dtype.name} of shape {pixels.shape} needs a pixel code")
    return found
