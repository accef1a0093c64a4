"""Defects of pictures that show without another camera: edges that stand still, and lines that do not fit.

All functions take pictures of the shape (height, width, colours), of 8 bits a colour.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

#: The least difference of neighbouring pixels that is an edge, of 255.
_EDGE = 24


class StillEdges(NamedTuple):
    """The pixels with an edge to the next one that stays, of all pixels and of those with an edge (per cent).

    ``where`` (height, width) are these pixels.
    """

    of_pixels: float
    of_edges: float
    where: NDArray[np.bool_]


def still_edges(pictures: Sequence[NDArray[np.uint8]]) -> StillEdges:
    """Return the edges between neighbouring pixels that are the same in all pictures.

    While a camera turns, what it sees moves through its pictures, in the directions of its turns. What stays in its
    place is in the camera: dead columns, pixels that are stuck, dirt, a broken lens. So the pictures have to be of
    several directions, or edges along the only one stay as well.
    """
    height, width = pictures[0].shape[:2]
    still, edges = np.zeros((2, height, width), dtype=np.bool_)
    for axis, place in ((0, np.s_[: height - 1, :]), (1, np.s_[:, : width - 1])):
        steps = [np.diff(picture.astype(np.int16), axis=axis) for picture in pictures]
        rises, falls = np.minimum.reduce(steps) >= _EDGE, np.maximum.reduce(steps) <= -_EDGE
        still[place] |= (rises | falls).any(axis=2)
        edges[place] |= (abs(steps[0]) >= _EDGE).any(axis=2)
    share = float(still.sum() / edges.sum()) if edges.any() else 0.0
    return StillEdges(100.0 * float(still.mean()), 100.0 * share, still)


def line_ratio(picture: NDArray[np.uint8]) -> float:
    """Return the difference of neighbouring lines, of that of lines two apart: below 1, for nearer ones are more alike.

    It is above 1 if every other line is of another moment, or is displaced. NaN for a picture without structure.
    """
    pixels = picture.astype(np.float64)
    near, far = (float(((pixels[apart:] - pixels[:-apart]) ** 2).mean()) for apart in (1, 2))
    return float(np.sqrt(near / far)) if far > 0.0 else float("nan")


def colourfulness(picture: NDArray[np.uint8]) -> float:
    """Return how far the colours of the pixels are apart, of their brightness: 0 of a grey picture, at any exposure."""
    pixels = picture.astype(np.float64)
    total = float(pixels.max(axis=2).sum())
    return float(np.ptp(pixels, axis=2).sum()) / total if total > 0.0 else 0.0
