"""The noise of a picture, from one picture alone.

J. Immerkaer, Fast noise variance estimation, 1996: the difference of two Laplacians leaves neither planes nor edges
that are straight, only noise. Here only its smaller half counts, so that corners and textures do not; and the mean of
this half, for the values of a picture are whole numbers, and their median would be one, too.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: What the mask makes of the standard deviation of white noise: its weights are (1, -2, 1) in each direction.
_WHITE = 6.0
#: The mean of the smaller half of the magnitudes of normal values, of their standard deviation: 4 (f(0) - f(0.6745)),
#: where f is the density and 0.6745 the median magnitude.
_SMALLER_HALF = 0.3247


def picture_noise(picture: NDArray[np.uint8]) -> float:
    """Return the standard deviation of the noise, in the unit of the pixels: of the noisiest colour.

    ``picture`` has the shape (height, width) or (height, width, colours), with three rows and columns or more.
    """
    left = picture.astype(np.float64)
    left = left[:-2] - 2.0 * left[1:-1] + left[2:]
    left = left[:, :-2] - 2.0 * left[:, 1:-1] + left[:, 2:]
    sizes = np.abs(left).reshape(left.shape[0] * left.shape[1], -1)
    half = sizes.shape[0] // 2
    return float(np.partition(sizes, half, axis=0)[: half + 1].mean(axis=0).max()) / _SMALLER_HALF / _WHITE
