"""How something that is controlled answers to a step: how fast, how far beyond, how soon at rest, how near."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from rtf.robot.interfaces import FloatArray

#: Of what is reached of the step: from here to there is the rise. That is counted as so much of the step at least.
_BEGUN, _RISEN = 0.1, 0.9
_REACHED = 0.5
#: Noise explains what is within so many of its standard deviations: hardly a point is beyond, also of noise that is
#: known by some dozen points.
EXPLAINED = 5.0
#: Points after a step, without which nothing is said of it.
FEWEST = 10
#: What is left of the time at the end for what is steady.
_STEADY_SHARE = 0.25
#: Bandwidth times rise time of a system of the first order, and nearly so of others that do not ring.
_BANDWIDTH = 0.35


class StepResponse(NamedTuple):
    """An answer to a step. Times in s from the step on, errors in what was measured, overshoot in per cent of the step.

    ``delay`` is until a tenth of what is reached in the end, ``rise_time`` from there to nine tenths: NaN where that
    never happens, or not by half of the step. ``overshoot`` is beyond the target, or beyond the end where that is
    further. ``settling_time`` is until it stays within the band, infinite when it does not. ``steady_error`` is of the
    mean of the last quarter, ``ripple`` the deviation from a line through it.
    """

    delay: float
    rise_time: float
    overshoot: float
    settling_time: float
    steady_error: float
    ripple: float

    @property
    def bandwidth(self) -> float:
        """About how fast (Hz) a signal may be that it follows; NaN where it does not rise."""
        return _BANDWIDTH / self.rise_time if self.rise_time > 0 else math.nan


def step_response(
    time: ArrayLike, values: ArrayLike, start: float, target: float, band: float, noise: float = 0.0
) -> StepResponse:
    """Judge an answer; ``time`` counts from the step, which goes from ``start`` to ``target``. ``band`` is to one side.

    ``noise`` is the standard deviation of what is measured: what it explains is not held against the answer.
    Raises ValueError when there are not at least ten points after the step, and for values that are no numbers.
    """
    t, v = np.asarray(time, dtype=np.float64), np.asarray(values, dtype=np.float64)
    if missing := int((~np.isfinite(v)).sum()):
        raise ValueError(f"{missing} of {v.size} values are no numbers")
    t, v = t[t >= 0], v[t >= 0]
    if t.size < FEWEST:
        raise ValueError(f"{t.size} points after the step say nothing of it; {FEWEST} are needed")
    last = max(FEWEST // 2, round(_STEADY_SHARE * t.size))
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
    )


def noise_before(time: FloatArray, values: FloatArray) -> float:
    """How far values are from a line through them in the latter half of the time before a step; 0 where few are."""
    half = int((time < 0).sum()) // 2
    before = slice(half, 2 * half)
    return _deviation(time[before], values[before]) if half >= FEWEST // 2 else 0.0


def _deviation(time: FloatArray, values: FloatArray) -> float:
    """How far values are from a line through them, root mean square."""
    line = np.polynomial.Polynomial.fit(time, values, 1)
    return float(np.std(values - line(time)))


def _first(time: FloatArray, share: FloatArray, level: float) -> float:
    """When a level is first reached, between two points by a straight line; NaN when it never is."""
    there = np.flatnonzero(share >= level)
    if there.size == 0:
        return math.nan
    place = int(there[0])
    if place == 0:
        return float(time[0])
    before, after = share[place - 1], share[place]
    return float(time[place - 1] + (level - before) / (after - before) * (time[place] - time[place - 1]))


def largest(values: Sequence[float]) -> float:
    """The greatest of some numbers; NaN when one of them is."""
    return float(np.max(values))


def spread_of(times: Sequence[FloatArray], values: Sequence[FloatArray], period: float) -> float:
    """How far repetitions are apart: the root of the mean square deviation from their mean, over what they share.

    NaN for a single one.
    """
    if len(times) < 2:  # noqa: PLR2004 - one has nothing to differ from
        return math.nan
    begin, end = max(t[0] for t in times), min(t[-1] for t in times)
    grid = np.arange(begin, end, period)
    together = np.array([np.interp(grid, t, v) for t, v in zip(times, values, strict=True)])
    return float(np.sqrt(np.mean(np.var(together, axis=0, ddof=1))))
