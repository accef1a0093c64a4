"""What differs between two campaigns, such as before and after a new firmware.

Every rate and distribution that both have is compared, and hundreds of comparisons find differences by chance alone.
Their p values are therefore adjusted after Y. Benjamini and Y. Hochberg (1995): of the differences that are reported at
most 5 % are expected to be chance. Holm's procedure would keep the chance of a single one below 5 %, and with hundreds
of measurements hide a change until it is gross; here a list is wanted of what to look at, as in the history.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from rtf.campaigns.report.detection import faulty_groups
from rtf.campaigns.report.distributions import measured_groups
from rtf.campaigns.report.verdicts import found, judged

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from rtf.campaigns.outcomes import Measured, Outcome
    from rtf.campaigns.report.detection import Curve
    from rtf.campaigns.report.rates import Rate
    from rtf.campaigns.report.summary import Report

#: The share of the reported differences that may be chance.
FALSE_DISCOVERIES = 0.05
#: Two shares, or their exact probabilities, that differ by less are equal; what is left is rounding.
_ROUNDING = 1e-7


@dataclass(frozen=True, slots=True)
class Change:
    """One comparison. ``what`` is ``detection``, ``right joint``, ``false alarms`` or ``distribution``.

    ``before`` and ``after`` are shares of 1, or the medians of a distribution in ``unit``. For detection ``limits`` are
    the detection limits before and after; None: not known. ``p`` is that of this comparison alone, ``adjusted``
    accounts for all of them, and ``significant`` says whether the difference is reported.
    """

    what: str
    test: str
    robot: str
    subject: str
    unit: str
    before: float
    after: float
    limits: tuple[float | None, float | None] | None
    p: float
    adjusted: float = 1.0
    significant: bool = False


@dataclass(frozen=True, slots=True)
class Comparison:
    """All comparisons of two campaigns, the most significant first, and what only one of them has."""

    before: str
    after: str
    changes: tuple[Change, ...]
    only_before: tuple[str, ...]
    only_after: tuple[str, ...]


def compare(
    before: Report, after: Report, outcomes_before: Sequence[Outcome], outcomes_after: Sequence[Outcome]
) -> Comparison:
    """Compare two campaigns, by their reports and the outcomes that these were made of."""
    found_changes = [
        *_detection(before, after, outcomes_before, outcomes_after),
        *_right_joints(before, after),
        *_alarms(before, after),
        *_distributions(outcomes_before, outcomes_after),
    ]
    one, other = _things(before), _things(after)
    return Comparison(
        before.name, after.name, _adjusted(found_changes), tuple(sorted(one - other)), tuple(sorted(other - one))
    )


def _things(report: Report) -> set[str]:
    curves = {f"{curve.test} with {curve.fault} on {curve.robot}" for curve in report.detection}
    return curves | {f"{one.test} on a healthy {one.robot}" for one in report.alarms}


def _adjusted(changes: Sequence[Change]) -> tuple[Change, ...]:
    if not changes:
        return ()
    from scipy.stats import false_discovery_control  # here and below: it takes a second to load

    adjusted = false_discovery_control([change.p for change in changes])
    done = [
        replace(change, adjusted=float(p), significant=bool(p <= FALSE_DISCOVERIES))
        for change, p in zip(changes, adjusted, strict=True)
    ]
    return tuple(sorted(done, key=lambda change: (change.adjusted, change.p, change.what, change.test, change.subject)))


# What is compared ----------------------------------------------------------------------------------------------------


def _detection(
    before: Report, after: Report, outcomes_before: Iterable[Outcome], outcomes_after: Iterable[Outcome]
) -> Iterator[Change]:
    """Compare shares at the severities and joints that both have tried: the test is exact, and needs no curve."""
    one, other = faulty_groups(outcomes_before), faulty_groups(outcomes_after)
    curves_before, curves_after = _curves(before), _curves(after)
    for key in one.keys() & other.keys():
        first, second = _counts(one[key]), _counts(other[key])
        strata = [(*first[stratum], *second[stratum]) for stratum in first.keys() & second.keys()]
        if strata:
            curve, later = curves_before[key], curves_after[key]
            yield Change(
                "detection",
                curve.test,
                curve.robot,
                f"{curve.fault} {curve.direction}".strip(),
                curve.unit,
                float(np.mean([hits / tried for hits, tried, _, _ in strata])),
                float(np.mean([hits / tried for _, _, hits, tried in strata])),
                (curve.limit.severity, later.limit.severity),
                exact_p(strata),
            )


def _curves(report: Report) -> dict[tuple[str, str, str, str], Curve]:
    return {(curve.test, curve.fault, curve.robot, curve.direction): curve for curve in report.detection}


def _counts(outcomes: Iterable[Outcome]) -> dict[tuple[str | None, float | None], tuple[int, int]]:
    """Return how many were found and tried at each joint and severity."""
    hits, tried = Counter[tuple[str | None, float | None]](), Counter[tuple[str | None, float | None]]()
    for outcome in outcomes:
        if judged(outcome):
            tried[outcome.joint, outcome.severity] += 1
            hits[outcome.joint, outcome.severity] += found(outcome)
    return {stratum: (hits[stratum], tried[stratum]) for stratum in tried}


def _right_joints(before: Report, after: Report) -> Iterator[Change]:
    later = _curves(after)
    for key, curve in _curves(before).items():
        if key in later:
            subject = f"{curve.fault} {curve.direction}".strip()
            yield from _rates(
                "right joint", (curve.test, curve.robot, subject), curve.right_joint, later[key].right_joint
            )


def _alarms(before: Report, after: Report) -> Iterator[Change]:
    later = {(one.test, one.robot): one.alarms for one in after.alarms}
    for one in before.alarms:
        if (one.test, one.robot) in later:
            yield from _rates("false alarms", (one.test, one.robot, ""), one.alarms, later[one.test, one.robot])


def _rates(what: str, place: tuple[str, str, str], before: Rate, after: Rate) -> Iterator[Change]:
    if before.share is not None and after.share is not None:
        p = exact_p([(before.count, before.trials, after.count, after.trials)])
        yield Change(what, *place, "", before.share, after.share, None, p)


def _distributions(outcomes_before: Iterable[Outcome], outcomes_after: Iterable[Outcome]) -> Iterator[Change]:
    """Compare measurements of healthy robots by the test of Kolmogorov and Smirnov, which sees shifts and spreads."""
    from scipy.stats import ks_2samp

    one, other = measured_groups(outcomes_before), measured_groups(outcomes_after)
    for key in one.keys() & other.keys():
        first, second = _finite(one[key]), _finite(other[key])
        if first and second:
            p = float(ks_2samp(first, second).pvalue)
            unit = other[key][0][1].unit
            yield Change("distribution", *key, unit, float(np.median(first)), float(np.median(second)), None, p)


def _finite(group: Iterable[tuple[int, Measured]]) -> list[float]:
    return [measured.value for _, measured in group if np.isfinite(measured.value)]


def exact_p(strata: Iterable[tuple[int, int, int, int]]) -> float:
    """Return the two-sided p value of the same share before and after in each stratum.

    A stratum is found and tried before, and found and tried after. Given how many were found in each, the number of
    those before is a sum of hypergeometric ones, whose distribution is computed exactly; all sums that are as unlikely
    as that which came, or more, count (with one stratum, Fisher's exact test).
    """
    from scipy.stats import hypergeom

    chances, place = np.ones(1), 0
    for hits, tried, later_hits, later_tried in strata:
        found_in_all = hits + later_hits
        least, most = max(0, found_in_all - later_tried), min(found_in_all, tried)
        row = hypergeom.pmf(np.arange(least, most + 1), tried + later_tried, found_in_all, tried)
        chances, place = np.convolve(chances, row), place + hits - least
    return min(1.0, float(chances[chances <= chances[place] * (1.0 + _ROUNDING)].sum()))
