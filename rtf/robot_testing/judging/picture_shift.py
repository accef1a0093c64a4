"""By how many pixels the content of a picture has moved: phase correlation of two pictures of one camera.

C. D. Kuglin and D. C. Hines, The phase correlation image alignment method, 1975. It needs texture, and a shift of less
than a quarter of the picture; it is exact to a tenth of a pixel for pictures that overlap by more than half.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Shift(NamedTuple):
    """The shift of a picture's content: to the right, and downwards (px), and the height of its peak, 1 at most."""

    right: float
    down: float
    peak: float


def shift_between(before: NDArray[np.uint8], after: NDArray[np.uint8]) -> Shift:
    """Return the shift from one picture to another, both of shape (height, width) or (height, width, colours)."""
    first, second = (_prepared(one) for one in (before, after))
    product = np.fft.rfft2(second) * np.conj(np.fft.rfft2(first))
    surface = np.fft.irfft2(product / np.maximum(np.abs(product), 1e-9), first.shape)
    row, column = np.unravel_index(int(np.argmax(surface)), surface.shape)
    down = _refined(surface[:, column], int(row))
    right = _refined(surface[row, :], int(column))
    return Shift(right, down, float(surface[row, column]))


def _prepared(picture: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return the brightness without its mean, fading towards the edges, which do not move."""
    grey = picture.astype(np.float64)
    grey = grey.mean(axis=2) if grey.ndim == 3 else grey  # noqa: PLR2004 - with colours
    faded: NDArray[np.float64] = (grey - grey.mean()) * np.multiply.outer(*(np.hanning(size) for size in grey.shape))
    return faded


def _refined(line: NDArray[np.float64], place: int) -> float:
    """Return the place of a peak between samples, by a parabola; beyond the middle it is negative."""
    before, at, after = line[place - 1], line[place], line[(place + 1) % line.size]
    curve = before - 2.0 * at + after
    exact = place + (0.5 * (before - after) / curve if curve < 0.0 else 0.0)
    return float(exact if exact <= line.size / 2 else exact - line.size)
