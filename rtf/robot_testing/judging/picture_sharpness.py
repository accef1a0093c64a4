"""The sharpness of a picture: how steep its edges are.

The root mean square of the differences between neighbouring pixels: a blurred edge is as high, and less steep, so the
sum of the squares falls with the width of the blur. It is a share of the contrast, so independent of the
exposure, and without what noise adds. Scenes differ, so only that of the same scene can be compared.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot_testing.judging.picture_noise import picture_noise

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: The share of noise in the differences of neighbouring pixels beyond which these do not show the sharpness.
_HIDDEN = 0.5


def picture_sharpness(picture: NDArray[np.uint8]) -> float:
    """Return the sharpness, 0 of a picture without contrast, NaN where noise hides it.

    ``picture`` has the shape (height, width) or (height, width, colours), with three rows and columns or more.
    """
    pixels = picture.reshape(*picture.shape[:2], -1).astype(np.float64)
    contrast = float(pixels.var(axis=(0, 1)).sum())
    if contrast == 0.0:
        return 0.0
    steps = float(sum((np.diff(pixels, axis=axis) ** 2).mean(axis=(0, 1)).sum() for axis in (0, 1))) / 2.0
    noise = 2.0 * sum(picture_noise(colour) ** 2 for colour in np.moveaxis(pixels, 2, 0))
    return math.sqrt((steps - noise) / contrast) if noise < _HIDDEN * steps else math.nan
