"""The statistics of verdicts: lines through points, periods of streams, delays of signals, and how sure they are."""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


#: The confidence that is stated where nothing else is said.
CONFIDENCE = 0.99


class Fit(NamedTuple):
    """A straight line through points: ``y = slope x + offset``, with half the width of the slope's interval.

    ``rms`` and ``largest`` are of what is left, ``correlation`` is Pearson's; NaN where x does not vary.
    """

    slope: float
    offset: float
    slope_interval: float
    rms: float
    largest: float
    correlation: float
    points: int


def fit_line(x: ArrayLike, y: ArrayLike, level: float = CONFIDENCE) -> Fit:
    """The line of least squares. Raises ValueError for fewer than three points."""
    xs, ys = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if xs.size < _FEWEST or xs.size != ys.size:
        raise ValueError(f"a line needs {_FEWEST} points or more, as many x as y: {xs.size} and {ys.size}")
    dx, dy = xs - xs.mean(), ys - ys.mean()
    spread = float(dx @ dx)
    slope = float(dx @ dy) / spread if spread > 0 else math.nan
    offset = float(ys.mean() - slope * xs.mean())
    left = ys - (slope * xs + offset)
    rms = float(np.sqrt(np.mean(left**2)))
    error = math.sqrt(float(left @ left) / max(1, xs.size - 2) / spread) if spread > 0 else math.nan
    both = math.sqrt(spread * float(dy @ dy))
    correlation = float(dx @ dy) / both if both > 0 else math.nan
    largest = float(np.abs(left).max())
    return Fit(slope, offset, quantile(level) * error, rms, largest, correlation, xs.size)


class Periods(NamedTuple):
    """The periods of a stream (s) and what follows from them. ``rate`` is intervals over their sum (Hz)."""

    messages: int
    rate: float
    mean: float
    median: float
    deviation: float
    shortest: float
    longest: float
    p99: float
    rate_interval: float


def periods_of(times: ArrayLike, level: float = CONFIDENCE) -> Periods:
    """The statistics of the times of messages (s), in the order in which they came. ValueError for fewer than three."""
    stamps = np.asarray(times, dtype=np.float64)
    if stamps.size < _FEWEST:
        raise ValueError(f"{stamps.size} messages have no rate; {_FEWEST} are needed")
    gaps = np.diff(stamps)
    mean, deviation = float(gaps.mean()), float(gaps.std(ddof=1))
    rate = 1.0 / mean if mean > 0 else math.inf
    sure = quantile(level) * deviation / math.sqrt(gaps.size) / mean * rate if mean > 0 else math.nan
    return Periods(
        stamps.size,
        rate,
        mean,
        float(np.median(gaps)),
        deviation,
        float(gaps.min()),
        float(gaps.max()),
        float(np.quantile(gaps, 0.99)),
        sure,
    )


def confidence(values: ArrayLike, level: float = CONFIDENCE) -> tuple[float, float]:
    """The mean of independent values, and half the width of its interval; infinite for a single one."""
    xs = np.asarray(values, dtype=np.float64)
    if xs.size < 2:  # noqa: PLR2004 - one value says nothing of its spread
        return float(xs.mean()), math.inf
    return float(xs.mean()), quantile(level) * float(xs.std(ddof=1)) / math.sqrt(xs.size)


def delay_between(reference: ArrayLike, answer: ArrayLike, period: float, most: float) -> float:
    """By how many seconds ``answer`` follows ``reference``, both sampled every ``period``; at most ``most``.

    It is the shift with the smallest mean square difference, to a fraction of a sample by a parabola through three.
    """
    a, b = np.asarray(reference, dtype=np.float64), np.asarray(answer, dtype=np.float64)
    shifts = range(min(len(a) - 2, round(most / period)) + 1)
    costs = [float(np.mean((b[shift:] - a[: len(a) - shift]) ** 2)) for shift in shifts]
    best = int(np.argmin(costs))
    fraction = 0.0
    if 0 < best < len(costs) - 1:
        before, at, after = costs[best - 1 : best + 2]
        curve = before - 2 * at + after
        fraction = (before - after) / (2 * curve) if curve > 0 else 0.0
    return (best + fraction) * period


def surely_beyond(values: ArrayLike, share: float, level: float = CONFIDENCE) -> float:
    """What the quantile ``share`` of that of which these are a sample is at least, with this confidence.

    One of the values, by the order statistics of a binomial distribution; the least for a small sample.
    """
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    count = ordered.size
    place = count * share - NormalDist().inv_cdf(level) * math.sqrt(count * share * (1.0 - share))
    return float(ordered[max(0, math.floor(place) - 1)])


def quantile(level: float) -> float:
    """How many standard errors wide half an interval of this confidence is."""
    return NormalDist().inv_cdf(0.5 + level / 2)


_FEWEST = 3
