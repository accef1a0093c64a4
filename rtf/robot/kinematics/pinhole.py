"""Pinhole cameras: pixels of points, and points of pixels. Lenses that distort are left out.

A camera looks along its z axis, its x axis is to the right in the picture and y is down. Pixels are (u, v) from the
upper left corner. Points are in metres, in the frame of the root; poses are those of the cameras there (4, 4).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.errors import RefusedError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

#: The cosine between a ray and a plane below which they do not meet.
_PARALLEL = 1e-9


@dataclass(frozen=True, slots=True)
class Pinhole:
    """The intrinsic parameters of a camera, in pixels."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The projection of a point in the frame of the camera to a pixel (3, 4)."""
        return np.array([[self.fx, 0.0, self.cx, 0.0], [0.0, self.fy, self.cy, 0.0], [0.0, 0.0, 1.0, 0.0]])

    def pixel_of(self, point: ArrayLike, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the pixel of a point, which may lie outside of the picture.

        Raises RefusedError for a point that is not in front of the camera.
        """
        x, y, z = pose[:3, :3].T @ (_vector(point, 3, "a point") - pose[:3, 3])
        if z <= 0.0:
            raise RefusedError(f"a point that is {-z:.4g} m behind the camera is not in its picture")
        return np.array([self.fx * x / z + self.cx, self.fy * y / z + self.cy])

    def ray_of(self, pixel: ArrayLike) -> NDArray[np.float64]:
        """Return the point of a pixel in the frame of the camera, at a depth of 1 m."""
        u, v = _vector(pixel, 2, "a pixel")
        return np.array([(u - self.cx) / self.fx, (v - self.cy) / self.fy, 1.0])

    def point_at(self, pixel: ArrayLike, depth: float, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the point of a pixel at a depth (m), which is along the axis of the camera."""
        point: NDArray[np.float64] = pose[:3, :3] @ (depth * self.ray_of(pixel)) + pose[:3, 3]
        return point

    def point_on(self, pixel: ArrayLike, plane: ArrayLike, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where the ray of a pixel meets the plane ``a x + b y + c z + d = 0``, given by its four numbers.

        Raises RefusedError for a plane that the ray does not meet in front of the camera.
        """
        a, b, c, d = _vector(plane, 4, "a plane")
        shown = f"the plane {a:g} {b:g} {c:g} {d:g}"
        normal, ray = np.array([a, b, c]), pose[:3, :3] @ self.ray_of(pixel)
        across = float(normal @ ray)
        if abs(across) <= _PARALLEL * float(np.linalg.norm(normal) * np.linalg.norm(ray)):
            raise RefusedError(f"the ray of a pixel is parallel to {shown}")
        depth = -float(normal @ pose[:3, 3] + d) / across
        if depth <= 0.0:
            raise RefusedError(f"the ray of a pixel meets {shown} behind the camera")
        point: NDArray[np.float64] = pose[:3, 3] + depth * ray
        return point


def triangulated(
    pixels: Sequence[ArrayLike], cameras: Sequence[Pinhole], poses: Sequence[NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Return the point that is at a pixel in each of two or more cameras: the least squares of their equations.

    Raises RefusedError where the rays do not determine it, as those of one camera.
    """
    rows = []
    for pixel, camera, pose in zip(pixels, cameras, poses, strict=True):
        x, y, _ = camera.ray_of(pixel)
        right, down, ahead = pose[:3, :3].T
        for axis, slope in ((right, x), (down, y)):
            row = axis - slope * ahead
            rows.append([*row, row @ pose[:3, 3]])
    table = np.array(rows)
    point, _, rank, _ = np.linalg.lstsq(table[:, :3], table[:, 3], rcond=1e-9)
    if rank < len(point):
        raise RefusedError("the rays of the pixels are parallel: they determine no point")
    return np.asarray(point, dtype=np.float64)


def _vector(values: ArrayLike, count: int, what: str) -> NDArray[np.float64]:
    vector = np.asarray(values, dtype=np.float64)
    if vector.shape != (count,) or not np.isfinite(vector).all():
        raise RefusedError(f"{what} has {count} numbers, not {values!r}")
    return vector
