"""Statistics of measurements: line fits, periods of streams, delays of signals, with confidence intervals."""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from rtf.robot.interfaces import FloatArray


#: The standard deviation of a normal distribution, by its median deviation.
NORMAL = 1.4826
#: The default confidence level.
CONFIDENCE = 0.99


class Fit(NamedTuple):
    """A line through points: ``y = slope x + offset``, with half the width of the slope's confidence interval.

    ``rms`` and ``largest`` are those of the residuals, ``correlation`` is Pearson's. NaN if x does not vary.
    """

    slope: float
    offset: float
    slope_interval: float
    rms: float
    largest: float
    correlation: float
    points: int


def fit_line(x: ArrayLike, y: ArrayLike, level: float = CONFIDENCE) -> Fit:
    """Return the least squares line. Raises ValueError for fewer than three points, or values that are not finite."""
    xs, ys = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if xs.size < _FEWEST or xs.size != ys.size:
        raise ValueError(f"a line needs {_FEWEST} points or more, as many x as y: {xs.size} and {ys.size}")
    if missing := int((~np.isfinite(xs) | ~np.isfinite(ys)).sum()):
        raise ValueError(f"a line needs finite numbers: {missing} of {xs.size} points are not finite")
    dx, dy = xs - xs.mean(), ys - ys.mean()
    spread = float(dx @ dx)
    slope = float(dx @ dy) / spread if spread > 0 else math.nan
    offset = float(ys.mean() - slope * xs.mean())
    left = ys - (slope * xs + offset)
    rms = float(np.sqrt(np.mean(left**2)))
    freedom = xs.size - 2
    error = math.sqrt(float(left @ left) / freedom / spread) if spread > 0 else math.nan
    both = math.sqrt(spread * float(dy @ dy))
    correlation = float(dx @ dy) / both if both > 0 else math.nan
    largest = float(np.abs(left).max())
    return Fit(slope, offset, student(level, freedom) * error, rms, largest, correlation, xs.size)


def line_end(values: FloatArray) -> FloatArray:
    """Return where the line through values at equal intervals ends, for each column of (values, columns).

    NaN for a column with NaN; there must be a value at least.
    """
    steps = np.arange(len(values)) - (len(values) - 1) / 2.0
    slopes = steps @ values / (float(steps @ steps) or 1.0)  # of a single value: 0
    end: FloatArray = values.mean(axis=0) + slopes * steps[-1]
    return end


class Periods(NamedTuple):
    """Statistics of the periods of a stream (s). ``rate`` is the number of intervals over their sum (Hz).

    ``rate_interval`` is half the width of its confidence interval, for messages that scatter about a constant period: a
    late message is followed by a short period, so the periods are not independent.
    """

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
    """Return the statistics of message times (s), in their order. Raises ValueError for fewer than three."""
    stamps = np.asarray(times, dtype=np.float64)
    if stamps.size < _FEWEST:
        raise ValueError(f"{stamps.size} messages have no rate; {_FEWEST} are needed")
    gaps = np.diff(stamps)
    mean, deviation = float(gaps.mean()), float(gaps.std(ddof=1))
    rate = 1.0 / mean if mean > 0 else math.inf
    return Periods(
        stamps.size,
        rate,
        mean,
        float(np.median(gaps)),
        deviation,
        float(gaps.min()),
        float(gaps.max()),
        float(np.quantile(gaps, 0.99)),
        _rate_interval(stamps, level) if mean > 0 else math.nan,
    )


def _rate_interval(stamps: FloatArray, level: float) -> float:
    """Return half the width of the confidence interval of a rate (Hz), from the scatter of the first and last stamp."""
    line = fit_line(np.arange(stamps.size), stamps)
    freedom, span = stamps.size - 2, float(stamps[-1] - stamps[0])
    off = line.rms * math.sqrt(2 * stamps.size / freedom)
    return student(level, freedom) * off / span * (stamps.size - 1) / span


def confidence(values: ArrayLike, level: float = CONFIDENCE) -> tuple[float, float]:
    """Return the mean of independent values, and half the width of its interval; infinite for a single value."""
    xs = np.asarray(values, dtype=np.float64)
    if xs.size < 2:  # noqa: PLR2004 - a spread needs two
        return float(xs.mean()), math.inf
    return float(xs.mean()), student(level, xs.size - 1) * float(xs.std(ddof=1)) / math.sqrt(xs.size)


def delay_between(reference: ArrayLike, answer: ArrayLike, period: float, most: float) -> float:
    """Return the delay (s) of ``answer`` behind ``reference``, both sampled every ``period``; at most ``most``.

    It is the shift with the least mean square difference, refined by a parabola through three samples.
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
    """Return a lower confidence bound of the quantile ``share`` of the population of a sample.

    It is one of the values, by order statistics (normal approximation of the binomial distribution); the least one for
    a small sample.
    """
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    count = ordered.size
    place = count * share - NormalDist().inv_cdf(level) * math.sqrt(count * share * (1.0 - share))
    return float(ordered[max(0, math.floor(place) - 1)])


def jitter(values: FloatArray) -> float:
    """Return the noise of values from state to state (standard deviation), by the median of their differences."""
    steps = np.diff(values)
    return float(np.median(np.abs(steps - np.median(steps)))) * NORMAL / math.sqrt(2.0) if len(steps) else 0.0


def student(level: float, freedom: int) -> float:
    """Return Student's t: half the width of a two-sided confidence interval, in estimated standard errors.

    ``freedom`` is the number of degrees of freedom, at least 1. Exact for 1 and 2, otherwise by the series of
    Abramowitz and Stegun, Handbook of Mathematical Functions, 26.7.5: within 1 % at 99 %.
    """
    if freedom == 1:
        return math.tan(level * math.pi / 2)
    if freedom == 2:  # noqa: PLR2004 - has a closed form, too
        return level * math.sqrt(2 / (1 - level**2))
    normal = NormalDist().inv_cdf(0.5 + level / 2)
    powers = [float(np.polyval(row, normal**2)) / freedom**power for power, row in enumerate(_STUDENT)]
    return normal * math.fsum(powers)


#: The polynomials of the series, in the square of the normal quantile: one for each power of 1 / freedom.
_STUDENT = (
    np.array([1.0]),
    np.array([1.0, 1.0]) / 4,
    np.array([5.0, 16.0, 3.0]) / 96,
    np.array([3.0, 19.0, 17.0, -15.0]) / 384,
    np.array([79.0, 776.0, 1482.0, -1920.0, -945.0]) / 92160,
)
_FEWEST = 3
