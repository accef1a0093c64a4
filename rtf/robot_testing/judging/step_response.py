"""Characteristics of a step response: delay, rise time, overshoot, settling time, steady-state error, ripple."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from rtf.robot.interfaces import FloatArray

#: The rise is from 10 % to 90 % of the final value, which counts as at least half of the step.
_BEGUN, _RISEN = 0.1, 0.9
_REACHED = 0.5
#: Deviations within this number of standard deviations are noise: hardly a point is beyond, even if the standard
#: deviation was estimated from a dozen points.
EXPLAINED = 5.0
#: Least number of points after a step.
FEWEST = 10
#: Share of the time at the end that counts as steady state.
STEADY_SHARE = 0.25
#: Bandwidth times rise time of a first-order system; about the same for others without oscillation.
_BANDWIDTH = 0.35


class StepResponse(NamedTuple):
    """A step response. Times are in s after the step, errors in the unit of the values, overshoot in % of the step.

    ``delay`` is the time to a tenth of the final value, ``rise_time`` that from a tenth to nine tenths: NaN if these
    are not reached, or less than half of the step is. ``overshoot`` is beyond the target, or beyond the final value if
    that is farther. ``settling_time`` is the time after which the value stays in the band; infinite if it does not.
    ``steady_error`` is that of the mean of the last quarter, ``ripple`` the deviation from a line through it, which has
    so many ``steady_points``.
    """

    delay: float
    rise_time: float
    overshoot: float
    settling_time: float
    steady_error: float
    ripple: float
    steady_points: int

    @property
    def bandwidth(self) -> float:
        """The approximate bandwidth (Hz), from the rise time; NaN without a rise."""
        return _BANDWIDTH / self.rise_time if self.rise_time > 0 else math.nan


def step_response(
    time: ArrayLike, values: ArrayLike, start: float, target: float, band: float, noise: float = 0.0
) -> StepResponse:
    """Evaluate a step response; ``time`` is relative to the step from ``start`` to ``target``. ``band`` is one-sided.

    ``noise`` is the standard deviation of the measurement; deviations that it explains do not count. Raises ValueError
    for a step of no height, for fewer than ten points after it, and for values that are not finite.
    """
    if start == target:
        raise ValueError(f"a step from {start:g} to {target:g} has no response")
    t, v = np.asarray(time, dtype=np.float64), np.asarray(values, dtype=np.float64)
    if missing := int((~np.isfinite(v)).sum()):
        raise ValueError(f"{missing} of {v.size} values are not finite")
    t, v = t[t >= 0], v[t >= 0]
    if t.size < FEWEST:
        raise ValueError(f"{t.size} points after the step are too few; {FEWEST} are needed")
    last = max(FEWEST // 2, round(STEADY_SHARE * t.size))
    final, height, explained = float(v[-last:].mean()), target - start, EXPLAINED * noise
    share, reached = (v - start) / height, (final - start) / height
    whole = max(_REACHED, reached)
    begun, risen = _first(t, share, _BEGUN * whole), _first(t, share, _RISEN * whole - noise / abs(height))
    outside = np.flatnonzero(np.abs(v - target) > band + explained)
    settled = 0.0 if outside.size == 0 else math.inf if outside[-1] == t.size - 1 else float(t[outside[-1] + 1])
    return StepResponse(
        delay=begun,
        rise_time=risen - begun,
        overshoot=100.0 * max(0.0, float(share.max()) - max(1.0, reached) - explained / abs(height)),
        settling_time=settled,
        steady_error=final - target,
        ripple=_deviation(t[-last:], v[-last:]),
        steady_points=last,
    )


def noise_before(time: FloatArray, values: FloatArray) -> float:
    """Return the deviation of the values from a line, in the latter half of the time before a step; NaN for too few."""
    half = int((time < 0).sum()) // 2
    before = slice(half, 2 * half)
    return _deviation(time[before], values[before]) if half >= FEWEST // 2 else math.nan


def with_noise(deviation: float, noise: float, points: int) -> float:
    """Return the deviation that values have with white noise, at most, where it is ``deviation`` without.

    Variances add up. That of ``points`` values, which is known with an error of ``sqrt(2 / (points - 1))`` of it, has
    five times this error on top. Raises ValueError for less than two points.
    """
    if points < 2:  # noqa: PLR2004 - a variance needs two
        raise ValueError(f"{points} points have no deviation")
    return math.sqrt(deviation**2 + noise**2 * (1.0 + EXPLAINED * math.sqrt(2.0 / (points - 1))))


def _deviation(time: FloatArray, values: FloatArray) -> float:
    """Return the root mean square deviation of values from a line through them."""
    line = np.polynomial.Polynomial.fit(time, values, 1)
    return float(np.std(values - line(time)))


def _first(time: FloatArray, share: FloatArray, level: float) -> float:
    """Return when a level is first reached, with linear interpolation; NaN if it never is."""
    there = np.flatnonzero(share >= level)
    if there.size == 0:
        return math.nan
    place = int(there[0])
    if place == 0:
        return float(time[0])
    before, after = share[place - 1], share[place]
    return float(time[place - 1] + (level - before) / (after - before) * (time[place] - time[place - 1]))


def largest(values: Sequence[float]) -> float:
    """Return the greatest of some numbers; NaN if one of them is NaN."""
    return float(np.max(values))


def spread_of(times: Sequence[FloatArray], values: Sequence[FloatArray], period: float) -> float:
    """Return the root mean square deviation of repetitions from their mean, over their common time.

    NaN for a single one.
    """
    if len(times) < 2:  # noqa: PLR2004 - a spread needs two
        return math.nan
    begin, end = max(t[0] for t in times), min(t[-1] for t in times)
    grid = np.arange(begin, end, period)
    together = np.array([np.interp(grid, t, v) for t, v in zip(times, values, strict=True)])
    return float(np.sqrt(np.mean(np.var(together, axis=0, ddof=1))))
