"""Measurements over the population of healthy robots: their distribution, and how well it fits between the limits."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rtf.campaigns.report.rates import Rate, exact_rate
from rtf.campaigns.report.verdicts import completed

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from rtf.campaigns.outcomes import Measured, Outcome

#: A limit with a smaller capability is tight: four standard deviations from the mean, the usual demand on a process.
CAPABLE = 4.0 / 3.0
_BINS = 24
#: The standard normal quantile for 95 % two-sided confidence.
_Z = 1.959963984540054
_FEWEST = 2


@dataclass(frozen=True, slots=True)
class Capability:
    """The distance of the mean to the nearer limit in three standard deviations, with its 95 % interval.

    The deviation is that over the population, so quality control would say Ppk. The interval is the approximation of
    A. F. Bissell (Applied Statistics 39, 1990), for values that are about normal.
    """

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Histogram:
    """Counts of values in bins of one width, from ``start`` on."""

    start: float
    width: float
    counts: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Distribution:
    """One measurement of one test over the runs of healthy robots of one kind.

    ``lower`` and ``upper`` are the limits if they were the same in all runs. ``outside`` is how many values violated
    the limits of their run, ``not_finite`` of which were no finite numbers; the other figures are of finite values.
    ``capability`` is None without limits, with fewer than two values, and if all values are equal. ``tight`` is the
    limit, ``lower`` or ``upper``, which is nearer than four standard deviations.
    """

    test: str
    robot: str
    name: str
    unit: str
    runs: int
    units: int
    not_finite: int
    outside: Rate
    mean: float | None
    deviation: float | None
    least: float | None
    p5: float | None
    median: float | None
    p95: float | None
    greatest: float | None
    lower: float | None
    upper: float | None
    capability: Capability | None
    tight: str
    histogram: Histogram | None


def distributions(outcomes: Iterable[Outcome]) -> tuple[Distribution, ...]:
    """Return the distributions of all measurements of completed runs on healthy robots, the least capable first."""
    found = [_distribution(key, group) for key, group in measured_groups(outcomes).items()]
    return tuple(sorted(found, key=_urgency))


Key = tuple[str, str, str]


def measured_groups(outcomes: Iterable[Outcome]) -> dict[Key, list[tuple[int, Measured]]]:
    """Return the units and values of each measurement of healthy robots, by test, robot and name."""
    groups: dict[Key, list[tuple[int, Measured]]] = defaultdict(list)
    for outcome in outcomes:
        if outcome.healthy and completed(outcome):
            for name, measured in outcome.measurements.items():
                groups[outcome.test, outcome.robot, name].append((outcome.unit, measured))
    return groups


def _urgency(one: Distribution) -> tuple[float, Key]:
    return (one.capability.value if one.capability else math.inf), (one.test, one.robot, one.name)


def _distribution(key: Key, group: Sequence[tuple[int, Measured]]) -> Distribution:
    values = np.array([measured.value for _, measured in group])
    lower = np.array([-np.inf if measured.lower is None else measured.lower for _, measured in group])
    upper = np.array([np.inf if measured.upper is None else measured.upper for _, measured in group])
    finite = np.isfinite(values)
    outside = int((~((values >= lower) & (values <= upper))).sum())
    kept = values[finite]
    least, p5, middle, p95, greatest = (
        map(float, np.quantile(kept, (0.0, 0.05, 0.5, 0.95, 1.0))) if len(kept) else (None,) * 5
    )
    capability, tight = _capability(kept, kept - lower[finite], upper[finite] - kept)
    limited = bool(np.isfinite(lower).any() or np.isfinite(upper).any())
    several = len(kept) >= _FEWEST
    return Distribution(
        *key,
        group[0][1].unit,
        len(group),
        len({unit for unit, _ in group}),
        int((~finite).sum()),
        exact_rate(outside, len(group)) if limited else exact_rate(0, 0),
        float(kept.mean()) if len(kept) else None,
        float(kept.std(ddof=1)) if several else None,
        least,
        p5,
        middle,
        p95,
        greatest,
        _only(lower),
        _only(upper),
        capability,
        tight,
        _histogram(kept),
    )


def _only(limits: NDArray[np.float64]) -> float | None:
    """Return the limit that all runs had, or None."""
    return float(limits[0]) if np.isfinite(limits[0]) and (limits == limits[0]).all() else None


def _capability(
    values: NDArray[np.float64], above_lower: NDArray[np.float64], below_upper: NDArray[np.float64]
) -> tuple[Capability | None, str]:
    """Return the capability and the tight limit. Distances are to the limits of each run, which may differ."""
    count = len(values)
    if count < _FEWEST or not float(np.ptp(values)):
        return None, ""
    nearest, tight = math.inf, ""
    for name, distances in (("lower", above_lower), ("upper", below_upper)):
        if np.isfinite(distances).all() and float(np.ptp(distances)):
            capability = float(distances.mean() / (3.0 * distances.std(ddof=1)))
            nearest, tight = min((nearest, tight), (capability, name))
    if not math.isfinite(nearest):
        return None, ""
    half = _Z * math.sqrt(1.0 / (9.0 * count) + nearest**2 / (2.0 * (count - 1)))
    return Capability(nearest, nearest - half, nearest + half), tight if nearest < CAPABLE else ""


def _histogram(values: NDArray[np.float64]) -> Histogram | None:
    if not len(values):
        return None
    start, span = float(values.min()), float(np.ptp(values))
    width = span / _BINS
    if not width or start + width == start:  # all equal, or as good as
        return Histogram(start, 0.0, (len(values),))
    places = np.minimum(((values - start) / width).astype(int), _BINS - 1)
    return Histogram(start, width, tuple(int(count) for count in np.bincount(places, minlength=_BINS)))
