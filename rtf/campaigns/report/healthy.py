"""What tests say of healthy robots: false alarms, and verdicts that change from run to run."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from rtf.campaigns.report.rates import Rate, exact_rate
from rtf.campaigns.report.verdicts import first_attempt_failed, found_rate, judged

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from rtf.campaigns.outcomes import Measured, Outcome

#: How far beyond its limit a value may be for chance alone, in standard deviations.
_NEAR = 3.0


@dataclass(frozen=True, slots=True)
class FalseAlarms:
    """How often a test raises an alarm on healthy robots. ``unjudged`` runs ended inconclusive, blocked or such."""

    test: str
    robot: str
    runs: int
    units: int
    alarms: Rate
    unjudged: int


class Steadiness(StrEnum):
    """Whether a test says the same of the same healthy robot twice."""

    STABLE = "stable"  # always
    FLAKY = "flaky"  # not always, and no measured value explains it
    MARGINAL = "marginal"  # not always, as a value is so close to its limit that chance decides
    UNKNOWN = "not known"  # no robot was tested twice


@dataclass(frozen=True, slots=True)
class Flakiness:
    """How often two runs of a test on the same healthy robot differ; ``measurement`` is the one that is marginal."""

    test: str
    robot: str
    differing: Rate
    verdict: Steadiness
    measurement: str


def false_alarms(outcomes: Iterable[Outcome]) -> tuple[FalseAlarms, ...]:
    """Return the false alarms of each test and robot, in their order."""
    return tuple(
        FalseAlarms(
            test,
            robot,
            len(group),
            len({outcome.unit for outcome in group}),
            found_rate(group),
            sum(not judged(outcome) for outcome in group),
        )
        for (test, robot), group in healthy_groups(outcomes)
    )


def healthy_groups(outcomes: Iterable[Outcome]) -> list[tuple[tuple[str, str], list[Outcome]]]:
    """Return the outcomes of healthy robots by test and robot."""
    groups: dict[tuple[str, str], list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        if outcome.healthy:
            groups[outcome.test, outcome.robot].append(outcome)
    return sorted(groups.items())


def flakiness(outcomes: Iterable[Outcome]) -> tuple[Flakiness, ...]:
    """Return the flakiness of each test and robot, in their order.

    The runs of a unit are taken in pairs that have no run in common, so that the pairs are independent and the interval
    exact. The first attempts are compared: a test that passes when it is tried again has changed its verdict, too.
    """
    return tuple(_flakiness(test, robot, group) for (test, robot), group in healthy_groups(outcomes))


def _flakiness(test: str, robot: str, group: Sequence[Outcome]) -> Flakiness:
    by_unit: dict[int, list[Outcome]] = defaultdict(list)
    for outcome in group:
        if judged(outcome):
            by_unit[outcome.unit].append(outcome)
    pairs = [pair for runs in by_unit.values() for pair in zip(runs[::2], runs[1::2], strict=False)]
    differing = [
        pair if first_attempt_failed(pair[0]) else pair[::-1]
        for pair in pairs
        if first_attempt_failed(pair[0]) is not first_attempt_failed(pair[1])
    ]
    rate = exact_rate(len(differing), len(pairs))
    if not differing:
        return Flakiness(test, robot, rate, Steadiness.STABLE if pairs else Steadiness.UNKNOWN, "")
    spreads = _spreads(group)
    causes = [_cause(failed.measurements, spreads) for failed, _ in differing]
    verdict = Steadiness.MARGINAL if all(causes) else Steadiness.FLAKY
    return Flakiness(test, robot, rate, verdict, causes[0] if verdict is Steadiness.MARGINAL else "")


def _spreads(group: Sequence[Outcome]) -> dict[str, float]:
    """Return the standard deviation of each measurement by its median deviation, which outliers do not bend."""
    from scipy.stats import median_abs_deviation  # it takes a second to load

    values: dict[str, list[float]] = defaultdict(list)
    for outcome in group:
        for name, measured in outcome.measurements.items():
            if np.isfinite(measured.value):
                values[name].append(measured.value)
    return {name: float(median_abs_deviation(of_one, scale="normal")) for name, of_one in values.items()}


def _cause(measurements: Mapping[str, Measured], spreads: Mapping[str, float]) -> str:
    """Return the measurement that failed a run, if each that is out of its limits is there by chance; else nothing."""
    outside = {name: _outside(measured) for name, measured in measurements.items()}
    beyond = {name: distance for name, distance in outside.items() if distance > 0.0}
    near = all(distance <= _NEAR * spreads.get(name, 0.0) for name, distance in beyond.items())
    return max(beyond, key=lambda name: beyond[name]) if beyond and near else ""


def _outside(measured: Measured) -> float:
    """Return how far a value is outside its limits; infinite for one that is no number, negative inside."""
    if np.isnan(measured.value):
        return float("inf")
    low = -np.inf if measured.lower is None else measured.lower
    high = np.inf if measured.upper is None else measured.upper
    return float(max(low - measured.value, measured.value - high))
