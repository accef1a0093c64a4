"""A red ball in a picture: its direction, and its distance by its size.

The outline of a ball is where a cone of rays touches it, so a cone is fitted to the rays of the outline: its axis
points to the centre also where the picture of a ball is no circle. Other red things, or a hand before the ball, leave a
part of the outline, which is enough: the cone on which most of it lies is sought first (RANSAC), with the same random
numbers each time.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.red_ball.regions import regions

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray
    from rtf.robot.kinematics import Pinhole

#: What is red: brighter than this, and more than so many times as bright as green and blue.
_BRIGHT, _RATIO = 20, 2
#: Red regions with fewer pixels are no ball, and no more than the largest ones are looked at.
_LEAST_PIXELS, _MOST_REGIONS = 40, 6
#: The distance (px) of an outline from the cone up to which it lies on it: half a pixel, and what a bright edge blurs.
_NEAR = 0.8
_TRIALS = 64
#: Parts of the outline, by direction, and the share of them that has to be seen.
_DIRECTIONS, _LEAST_SEEN = 36, 0.4
#: The share of the disk that has to be red: a hand before it hides the rest.
_LEAST_RED = 0.5
#: Every so many pixels are looked at for that.
_STRIDE = 2
#: The least radius in the picture (px): a smaller disk has no distance.
_LEAST_RADIUS = 4.0


class SeenBall(NamedTuple):
    """A ball in a picture."""

    place: FloatArray  # its centre in the frame of the camera: x to the right, y down, z ahead (m), by its size
    pixel: FloatArray  # of its centre (u, v)
    likelihood: float  # the share of its outline that is seen, from 0 to 1


def find_ball(picture: NDArray[np.uint8], camera: Pinhole, radius: float) -> SeenBall | None:
    """Return the red ball of a picture (height, width, RGB), None if it shows none.

    ``radius`` is that of the ball (m). Pixels are counted from the upper left corner of the picture, so the centre
    of the first one is at 0.5.
    """
    red = _reds(picture)
    found = [_seen(cone, red, camera, radius) for cone in _cones(red, camera)]
    seen = [one for one in found if one is not None]
    return max(seen, key=lambda one: one.likelihood, default=None)


def _reds(picture: NDArray[np.uint8]) -> NDArray[np.bool_]:
    red, green, blue = (picture[..., channel].astype(np.int16) for channel in range(3))
    found: NDArray[np.bool_] = (red > _BRIGHT) & (red > _RATIO * green) & (red > _RATIO * blue)
    return found


def _cones(red: NDArray[np.bool_], camera: Pinhole) -> list[FloatArray]:
    """Return the cone of each large region: its axis, divided by the cosine of the angle to its surface."""
    cones = []
    for region in regions(red, _LEAST_PIXELS)[:_MOST_REGIONS]:
        cone = _cone(_rays(_outline(region), camera), camera.fx)
        if cone is not None:
            cones.append(cone)
    return cones


def _outline(region: NDArray[np.bool_]) -> FloatArray:
    """Return where the region ends within the picture, midway between pixels (n, 2)."""
    rows, columns = np.nonzero(region[:, 1:] != region[:, :-1])
    across = np.column_stack([columns + 1.0, rows + 0.5])
    rows, columns = np.nonzero(region[1:] != region[:-1])
    return np.concatenate([across, np.column_stack([columns + 0.5, rows + 1.0])])


def _rays(pixels: FloatArray, camera: Pinhole) -> FloatArray:
    """Return the directions of pixels in the frame of the camera, of length 1 (n, 3)."""
    x, y = (pixels[:, 0] - camera.cx) / camera.fx, (pixels[:, 1] - camera.cy) / camera.fy
    rays = np.column_stack([x, y, np.ones(len(pixels))])
    directions: FloatArray = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    return directions


def _cone(rays: FloatArray, focal: float) -> FloatArray | None:
    """Return the cone on which most rays lie; None if there is none. On it the product with each ray is 1."""
    if len(rays) < 3:  # noqa: PLR2004 - a cone has three numbers
        return None
    chosen = np.random.default_rng(0).integers(len(rays), size=(_TRIALS, 3))
    triples = rays[chosen]
    able = np.abs(np.linalg.det(triples)) > 1e-12  # noqa: PLR2004 - three different rays
    if not able.any():
        return None
    cones = np.linalg.solve(triples[able], np.ones((int(able.sum()), 3, 1)))[..., 0]
    best = cones[np.argmax(_on(cones, rays, focal).sum(axis=1))]
    for _ in range(2):
        on = _on(best, rays, focal)
        best = np.linalg.lstsq(rays[on], np.ones(on.sum()), rcond=None)[0]
    cone: FloatArray = best
    return cone if np.linalg.norm(cone) > 1.0 else None


def _on(cones: FloatArray, rays: FloatArray, focal: float) -> NDArray[np.bool_]:
    """Return which rays lie on a cone, or on each of several, up to a part of a pixel."""
    # The product with a ray changes by the tangent of the cone's angle when the ray leaves the cone by a radian.
    tangents = np.sqrt(np.maximum((cones**2).sum(axis=-1) - 1.0, 0.0))
    near: NDArray[np.bool_] = np.abs(cones @ rays.T - 1.0) * focal < _NEAR * tangents[..., None]
    return near


def _seen(cone: FloatArray, red: NDArray[np.bool_], camera: Pinhole, radius: float) -> SeenBall | None:
    """Return the ball of a cone; None if too little of the picture agrees."""
    size = float(np.linalg.norm(cone))
    axis, sine = cone / size, math.sqrt(1.0 - 1.0 / size**2)
    if axis[2] <= 0.0 or sine * camera.fx < _LEAST_RADIUS:
        return None
    rays = _rays(_outline(red), camera)
    rays = rays[_on(cone, rays, camera.fx)]
    across = np.cross(axis, [0.0, 1.0, 0.0])
    along = np.cross(axis, across)
    bins = np.floor((np.arctan2(rays @ along, rays @ across) / (2.0 * math.pi) + 0.5) * _DIRECTIONS)
    share = len(np.unique(bins % _DIRECTIONS)) / _DIRECTIONS
    if share < _LEAST_SEEN or _redness(red, axis, 1.0 / size, camera) < _LEAST_RED:
        return None
    pixel = np.array([camera.fx * axis[0] / axis[2] + camera.cx, camera.fy * axis[1] / axis[2] + camera.cy])
    return SeenBall(axis * radius / sine, pixel, share)


def _redness(red: NDArray[np.bool_], axis: FloatArray, cosine: float, camera: Pinhole) -> float:
    """Return the share of a disk that is red, of what of it is in the picture."""
    rows, columns = (np.arange(0, size, _STRIDE) for size in red.shape)
    x, y = (columns + 0.5 - camera.cx) / camera.fx, (rows[:, None] + 0.5 - camera.cy) / camera.fy
    inside = x * axis[0] + y * axis[1] + axis[2] > cosine * np.sqrt(x * x + y * y + 1.0)
    return float(red[::_STRIDE, ::_STRIDE][inside].mean()) if inside.any() else 0.0
