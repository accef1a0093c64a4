"""A line through points of which both coordinates are measured, with noise, play and outliers in either.

Ordinary least squares takes x for exact: noise in x makes the slope too small, and one outlier in x can set it at will.
So the line is fitted in both directions, y by x and x by y, each without outliers. The first slope is too small by the
noise of x, the second too large by the noise of y; the true slope is between them (Frisch's bounds; Fuller, Measurement
Error Models, 1987, 1.1).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot_testing.judging.statistics import NORMAL

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from rtf.robot.interfaces import FloatArray

#: The first estimate is the median slope between pairs of points (Theil and Sen), of so many points at most.
_POINTS = 300
#: Outliers are farther from the line than this number of standard deviations, which are estimated from the median
#: deviation.
_OUTLYING = 4.0
#: Least deviation that makes an outlier, as a share of the spread: points without noise lie on the line exactly.
_EXACT = 1e-3
_ROUNDS = 3
_FEWEST = 3


class Slopes(NamedTuple):
    """The slopes in both directions, in their order, and the share of the points that are outliers.

    The slope of x by y is infinite if y does not follow x at all.
    """

    low: float
    high: float
    outliers: float

    def nearest(self, expected: float) -> float:
        """Return the possible slope that is nearest to an expected one."""
        return min(max(expected, self.low), self.high)


def slopes_between(x: ArrayLike, y: ArrayLike) -> Slopes:
    """Return the slopes of a line through points. Raises ValueError for fewer than three, and for x without spread."""
    xs, ys = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if xs.size < _FEWEST or xs.size != ys.size:
        raise ValueError(f"a line needs {_FEWEST} points or more, as many x as y: {xs.size} and {ys.size}")
    if not np.ptp(xs) > 0:
        raise ValueError("a line needs points with different x")
    inside = _inliers(xs, ys)
    forward = _slope(xs[inside], ys[inside])
    turned = _slope(ys[inside], xs[inside])
    backward = 1.0 / turned if turned else math.copysign(math.inf, forward)
    low, high = sorted((forward, backward))
    return Slopes(low, high, 1.0 - float(inside.mean()))


def _inliers(x: FloatArray, y: FloatArray) -> NDArray[np.bool_]:
    """Return the points near the line: first of the median slope, then of least squares through those near it."""
    step = max(1, math.ceil(x.size / _POINTS))
    rows, columns = np.triu_indices(x[::step].size, 1)
    dx, dy = x[::step][rows] - x[::step][columns], y[::step][rows] - y[::step][columns]
    far = np.abs(dx) > 0.5 * float(np.median(np.abs(dx)))  # near pairs show noise
    slope = float(np.median(dy[far] / dx[far])) if far.any() else 0.0
    least = _EXACT * float(np.ptp(y))
    inside = np.ones(x.size, dtype=bool)
    for _ in range(_ROUNDS):
        away = y - slope * x
        away = np.abs(away - np.median(away[inside]))
        near = away <= max(least, _OUTLYING * NORMAL * float(np.median(away)))
        if not np.ptp(x[near]) > 0:
            break
        inside, slope = near, _slope(x[near], y[near])
    return inside


def _slope(x: FloatArray, y: FloatArray) -> float:
    dx, dy = x - x.mean(), y - y.mean()
    spread = float(dx @ dx)
    return float(dx @ dy) / spread if spread > 0 else 0.0
