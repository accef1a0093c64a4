"""The points in space that a depth image shows."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.interfaces import Intrinsics


def points_of(
    depth: NDArray[Any], intrinsics: Intrinsics, clip_planes: tuple[float, float] = (0.0, math.inf)
) -> NDArray[np.float32]:
    """Return the points that a depth image of shape (height, width) shows, in m, shape (height, width, 3).

    The frame is that of the camera: x to the right, y down, z away from it. A point is NaN where the depth is 0, not
    finite or not between the clip planes. The distortion is not corrected: the image must be rectified.
    """
    near, far = clip_planes
    height, width = depth.shape
    with np.errstate(invalid="ignore"):  # NaN is no measurement
        measured = np.isfinite(depth) & (depth > 0.0) & (depth >= near) & (depth <= far)
    z = np.where(measured, depth, np.nan)
    x = (np.arange(width) - intrinsics.centre_x) / intrinsics.focal_x
    y = (np.arange(height) - intrinsics.centre_y) / intrinsics.focal_y
    return np.stack([z * x, z * y[:, np.newaxis], z], axis=2).astype(np.float32)
