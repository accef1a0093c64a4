"""Detection curves: from which size on a test finds a fault, for each test and kind of fault.

The curve is a logistic one over the logarithm of the severity, as usual for probabilities of detection (MIL-HDBK-1823A,
section G.3). Where no such curve is the most likely one, because a severity separates what was found from what was not,
the levels stand for themselves, each with its exact interval, and ``reason`` says why.
"""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rtf.campaigns.report.logistic import Logistic, fit_logistic
from rtf.campaigns.report.rates import Rate, exact_rate
from rtf.campaigns.report.verdicts import found, found_rate, judged, right_joint

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from rtf.campaigns.outcomes import Outcome
    from rtf.campaigns.report.logistic import Numbers

#: The share of the faults that a test must find from its detection limit on.
WANTED = 0.99
#: More severities than these, with fewer runs each, were drawn rather than chosen: they are shown in groups of equal
#: size.
_MOST_LEVELS, _FEWEST_RUNS = 12, 4
_GROUPS = 8
#: Points of the drawn curve: over the severities, and over the part where it rises.
_POINTS, _RISING = 40, (0.001, 0.999)
_FEWEST = 2
#: How far the drawn curve goes beyond the severities that were tried.
_BEYOND = 1.25
#: A detection limit beyond the severities is still drawn up to so many times the greatest.
_FARTHEST = 2.0
#: The logarithm of the greatest number.
_GREATEST = float(np.log(np.finfo(float).max))


@dataclass(frozen=True, slots=True)
class Level:
    """The runs of one severity, or of a group between ``least`` and ``greatest`` with this mean severity."""

    severity: float
    least: float
    greatest: float
    found: Rate


@dataclass(frozen=True, slots=True)
class Point:
    """The curve at a severity, with its 95 % band."""

    severity: float
    share: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Limit:
    """The severity from which on the test finds 99 % of the faults, and its 95 % interval; None: not known.

    ``extrapolated`` limits are beyond what was tried. Without a curve ``severity`` is the smallest from which on all
    were found, and ``low`` the greatest at which fewer than 99 % are found for certain.
    """

    severity: float | None
    low: float | None
    high: float | None
    extrapolated: bool = False


@dataclass(frozen=True, slots=True)
class JointRate:
    """How many of the faults at one joint were found."""

    joint: str
    found: Rate


@dataclass(frozen=True, slots=True)
class Curve:
    """How well one test finds one kind of fault of one robot, in one direction.

    ``direction`` is ``+`` or ``-`` where severities have both signs, and empty elsewhere; severities are sizes without
    sign, in ``unit``. ``method`` is ``logistic``, ``levels`` or, for faults without a size, ``rate``.
    """

    test: str
    robot: str
    fault: str
    direction: str
    unit: str
    method: str
    reason: str
    runs: int
    found: Rate
    right_joint: Rate
    joints: tuple[JointRate, ...]
    levels: tuple[Level, ...]
    points: tuple[Point, ...]
    limit: Limit


_UNKNOWN = Limit(None, None, None)


def detection_curves(outcomes: Iterable[Outcome], unit_of: Callable[[str], str]) -> tuple[Curve, ...]:
    """Return the curves of all tests and faults. ``unit_of`` returns the unit of the severities of a kind of fault."""
    return tuple(_curve(group, key[3], unit_of(key[1])) for key, group in faulty_groups(outcomes).items())


#: Test, fault, robot and direction.
Key = tuple[str, str, str, str]


def faulty_groups(outcomes: Iterable[Outcome]) -> dict[Key, list[Outcome]]:
    """Return the outcomes that belong to a curve, those of robots with a fault, in the order of the curves."""
    groups: dict[tuple[str, str, str], list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        if outcome.fault is not None:
            groups[outcome.test, outcome.fault, outcome.robot].append(outcome)
    return {
        (*key, direction): these for key, group in sorted(groups.items()) for direction, these in _directions(group)
    }


def _directions(group: Sequence[Outcome]) -> list[tuple[str, list[Outcome]]]:
    """Return the outcomes of each sign of the severity, if there are both; a fault without a size has none."""
    negative = [outcome for outcome in group if (outcome.severity or 0.0) < 0.0]
    others = [outcome for outcome in group if not (outcome.severity or 0.0) < 0.0]
    if negative and others:
        return [("-", negative), ("+", others)]
    return [("-" if negative else "", [*group])]


def _curve(group: Sequence[Outcome], direction: str, unit: str) -> Curve:
    these = [outcome for outcome in group if judged(outcome)]
    graded = [outcome for outcome in these if outcome.severity is not None]
    sizes = np.array([abs(outcome.severity or 0.0) for outcome in graded])
    hits = np.array([float(found(outcome)) for outcome in graded])
    fit, reason = _fit(sizes, hits)
    levels = _levels(sizes, hits)
    method = "rate" if not graded else "logistic" if fit is not None else "levels"
    named = [right_joint(outcome) for outcome in these if found(outcome) and outcome.joint is not None]
    first = group[0]
    return Curve(
        test=first.test,
        robot=first.robot,
        fault=first.fault or "",
        direction=direction,
        unit=unit,
        method=method,
        reason=reason if graded else "",
        runs=len(group),
        found=found_rate(these),
        right_joint=exact_rate(sum(named), len(named)),
        joints=_joints(these),
        levels=levels,
        points=_points(fit, sizes) if fit is not None else (),
        limit=_limit_of_curve(fit, sizes) if fit is not None else _limit_of_levels(levels),
    )


def _joints(these: Sequence[Outcome]) -> tuple[JointRate, ...]:
    by_joint: dict[str, list[Outcome]] = defaultdict(list)
    for outcome in these:
        by_joint[outcome.joint or ""].append(outcome)
    return tuple(JointRate(joint, found_rate(group)) for joint, group in sorted(by_joint.items()))


def _fit(sizes: Numbers, hits: Numbers) -> tuple[Logistic | None, str]:
    """Return the curve over the logarithm of the severity, or None and the reason."""
    some = sizes > 0.0
    logarithms, place = np.unique(np.log(sizes[some]), return_inverse=True)
    trials = np.bincount(place).astype(float)
    caught = np.bincount(place, weights=hits[some]).astype(float)
    if len(logarithms) < _FEWEST:
        return None, f"{len(logarithms) or 'no'} severity was tried"
    fit = fit_logistic(logarithms, caught, trials)
    if fit is None:
        return None, _why_not(caught, trials)
    return (fit, "") if fit.slope > 0.0 else (None, "greater faults are not found more often than smaller ones")


def _why_not(caught: Numbers, trials: Numbers) -> str:
    if (caught == trials).all():
        return "all were found: the limit is below the smallest severity that was tried"
    if not caught.any():
        return "none was found: the limit is above the greatest severity that was tried"
    return "a severity separates what was found from what was not: try more severities around it"


def _levels(sizes: Numbers, hits: Numbers) -> tuple[Level, ...]:
    if not len(sizes):
        return ()
    distinct = np.unique(sizes)
    order = np.argsort(sizes, kind="stable")
    if len(distinct) > _MOST_LEVELS and len(sizes) < _FEWEST_RUNS * len(distinct):
        groups = np.array_split(order, _GROUPS)
    else:
        groups = [np.flatnonzero(sizes == size) for size in distinct]
    return tuple(_level(sizes[group], hits[group]) for group in groups)


def _level(sizes: Numbers, hits: Numbers) -> Level:
    least, greatest = float(sizes.min()), float(sizes.max())
    mean = least if least == greatest else float(sizes.mean())  # the mean of equal numbers may be another one
    return Level(mean, least, greatest, exact_rate(int(hits.sum()), len(hits)))


def _points(fit: Logistic, sizes: Numbers) -> tuple[Point, ...]:
    least, greatest = float(sizes[sizes > 0.0].min()), float(sizes.max())
    limit = _size(fit.reaches(WANTED)[0]) or greatest
    end = limit if greatest < limit < _FARTHEST * greatest else greatest
    low, high = math.log(least / _BEYOND), math.log(end * _BEYOND)
    first, last = (fit.reaches(share)[0] for share in _RISING)
    rising = np.linspace(first, last, _POINTS)
    grid = np.unique([*np.linspace(low, high, _POINTS), *rising[(low < rising) & (rising < high)]])
    rows = np.column_stack([np.exp(grid), *fit.shares(grid)])
    return tuple(Point(*map(float, row)) for row in rows)


def _limit_of_curve(fit: Logistic, sizes: Numbers) -> Limit:
    severity, low, high = (_size(logarithm) for logarithm in fit.reaches(WANTED))
    return Limit(severity, low, high, extrapolated=severity is None or severity > float(sizes.max()))


def _size(logarithm: float | None) -> float | None:
    """Return the severity of a logarithm; None for one that is too great for a number."""
    if logarithm is None or logarithm > _GREATEST:
        return None
    return float(np.exp(logarithm))


def _limit_of_levels(levels: Sequence[Level]) -> Limit:
    """Return the smallest level from which on all were found, and the greatest that is below the limit for certain."""
    if not levels:
        return _UNKNOWN
    missed = [level for level in levels if level.found.count < level.found.trials]
    above = [level for level in levels if not missed or level.severity > missed[-1].severity]
    short = [level.severity for level in levels if level.found.high < WANTED]
    enough = [level.severity for level in above if level.found.low >= WANTED]
    return Limit(above[0].severity if above else None, short[-1] if short else None, enough[0] if enough else None)
