"""The report of a campaign: all that its outcomes teach, as plain data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rtf.campaigns.report.costs import Choice, Cost, choices, costs
from rtf.campaigns.report.detection import Curve, detection_curves
from rtf.campaigns.report.distributions import Distribution, distributions
from rtf.campaigns.report.healthy import FalseAlarms, Flakiness, false_alarms, flakiness

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.campaigns.outcomes import Outcome


@dataclass(frozen=True, slots=True)
class Size:
    """How much was run: ``seconds`` are those of all runs together."""

    runs: int
    healthy: int
    tests: int
    robots: tuple[str, ...]
    units: int
    faults: int
    seconds: float
    processor_seconds: float


@dataclass(frozen=True, slots=True)
class Report:
    """All that a campaign teaches. ``name`` is that of the campaign."""

    name: str
    size: Size
    detection: tuple[Curve, ...]
    alarms: tuple[FalseAlarms, ...]
    flakiness: tuple[Flakiness, ...]
    distributions: tuple[Distribution, ...]
    costs: tuple[Cost, ...]
    choices: tuple[Choice, ...]


@np.errstate(over="ignore", invalid="ignore")  # a test may measure numbers whose sum is none; the report has null then
def make_report(outcomes: Sequence[Outcome], name: str, budget: float | None = None) -> Report:
    """Return the report of these outcomes; ``budget`` is the time for the chosen tests, in seconds."""
    curves = detection_curves(outcomes, severity_unit)
    prices = costs(outcomes)
    return Report(
        name,
        _size(outcomes),
        curves,
        false_alarms(outcomes),
        flakiness(outcomes),
        distributions(outcomes),
        prices,
        choices(curves, prices, budget),
    )


def severity_unit(fault: str) -> str:
    """Return the unit of the severity of a kind of fault; empty for one that is not known here any more."""
    from rtf.robot.errors import RefusedError
    from rtf.simulator.faults import find_kind

    try:
        parameters = find_kind(fault).parameters
    except RefusedError:
        return ""
    return parameters[0].unit if parameters else ""


def _size(outcomes: Sequence[Outcome]) -> Size:
    return Size(
        len(outcomes),
        sum(outcome.healthy for outcome in outcomes),
        len({outcome.test for outcome in outcomes}),
        tuple(sorted({outcome.robot for outcome in outcomes})),
        len({(outcome.robot, outcome.unit) for outcome in outcomes}),
        len({outcome.fault for outcome in outcomes if outcome.fault is not None}),
        sum(outcome.seconds for outcome in outcomes),
        sum(outcome.processor_seconds for outcome in outcomes),
    )
