"""The noise of a picture, from one picture alone.

J. Immerkaer, Fast noise variance estimation, 1996: the difference of two Laplacians leaves neither planes nor edges
that are straight, only noise. Here its median counts instead of its mean, so that corners and textures do not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot_testing.judging.statistics import NORMAL

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: What the mask makes of the standard deviation of white noise: its weights are (1, -2, 1) in each direction.
_WHITE = 6.0


def picture_noise(picture: NDArray[np.uint8]) -> float:
    """Return the standard deviation of the noise, in the unit of the pixels: of the noisiest colour.

    ``picture`` has the shape (height, width) or (height, width, colours), with three rows and columns or more.
    """
    left = picture.astype(np.float64)
    left = left[:-2] - 2.0 * left[1:-1] + left[2:]
    left = left[:, :-2] - 2.0 * left[:, 1:-1] + left[:, 2:]
    return float(np.median(np.abs(left), axis=(0, 1)).max()) * NORMAL / _WHITE
