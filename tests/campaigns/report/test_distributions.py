"""Distributions and capabilities of measurements, against known distributions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.campaigns import Measured, Outcome
from rtf.campaigns.report.distributions import Distribution, distributions
from rtf.testing.verdict import Verdict
from simulated_truth import faulty, measured, outcome


def only(outcomes: list[Outcome]) -> Distribution:
    """Return the only distribution."""
    (found,) = distributions(outcomes)
    return found


def test_the_capability_is_that_of_the_truth():
    """Normal values of deviation 0.1 about 1.0 with limits at 0.5 and 1.3: the upper one is at three deviations."""
    values = np.random.default_rng(1).normal(1.0, 0.1, 20_000)
    found = only(measured(values, 0.5, 1.3))
    assert found.capability is not None
    assert found.capability.value == pytest.approx(1.0, rel=0.02)
    assert found.tight == "upper"
    assert (found.median, found.p5, found.p95) == (
        pytest.approx(1.0, abs=0.01),
        pytest.approx(0.8355, abs=0.01),
        pytest.approx(1.1645, abs=0.01),
    )
    assert found.outside.share == pytest.approx(0.00135, abs=0.001)


def test_the_interval_of_the_capability_covers_the_truth():
    """In about 95 of 100 campaigns with 40 units."""
    random = np.random.default_rng(2)
    found = [only(measured(random.normal(0.0, 1.0, 40), None, 4.0)).capability for _ in range(300)]
    inside = np.mean([one is not None and one.low <= 4.0 / 3.0 <= one.high for one in found])
    assert 0.91 <= inside <= 0.99


def test_limits_may_differ_from_run_to_run():
    """What counts is the distance to the limit of the run; the limits that are shown are those that all have."""
    values = np.random.default_rng(3).normal(0.0, 1.0, 4000)
    outcomes = [
        outcome(unit=unit, measurements={"error": Measured(100.0 * unit + value, "deg", None, 100.0 * unit + 6.0)})
        for unit, value in enumerate(values)
    ]
    found = only(outcomes)
    assert found.capability is not None
    assert found.capability.value == pytest.approx(2.0, rel=0.05)
    assert (found.upper, found.tight) == (None, "")


@pytest.mark.parametrize(
    ("values", "upper"), [([1.0], 2.0), ([1.0, 1.0, 1.0], 2.0), ([1.0, 2.0, 3.0], None), ([], 1.0)]
)
def test_there_may_be_no_capability(values: list[float], upper: float | None):
    """One value, equal values, or no limit: nothing can be said of the distance in deviations."""
    found = distributions(measured(values, None, upper))
    assert all(one.capability is None and one.tight == "" for one in found)


def test_values_that_are_no_numbers_are_counted_apart():
    """They violate limits, and are in no mean."""
    found = only([*measured([1.0, 2.0], None, 3.0), *measured([math.nan, math.inf], None, 3.0)])
    assert (found.runs, found.not_finite, found.outside.count, found.mean) == (4, 2, 2, 1.5)


def test_only_healthy_robots_that_were_judged_are_the_population():
    """Faults move values on purpose, and a run that ended early has measured half of it."""
    one = {"error": Measured(1.0, "deg")}
    outcomes = [outcome(measurements=one), faulty(1.0, found=True, measurements=one)]
    assert only([*outcomes, outcome(Verdict.ERROR, measurements=one)]).runs == 1


def test_the_least_capable_comes_first():
    """What needs attention is at the top; what has no capability is at the end."""
    outcomes = [
        outcome(
            unit=unit,
            measurements={
                "free": Measured(value),
                "wide": Measured(value, "", None, 9.0),
                "tight": Measured(value, "", None, 3.0),
            },
        )
        for unit, value in enumerate([1.0, 2.0, 1.5])
    ]
    assert [one.name for one in distributions(outcomes)] == ["tight", "wide", "free"]


@given(st.lists(st.floats(allow_nan=True, allow_infinity=True, width=32), min_size=1, max_size=40))
def test_a_histogram_has_all_finite_values(values: list[float]):
    """Each in one bin, whatever they are."""
    found = only(measured(values))
    finite = [value for value in values if math.isfinite(value)]
    counts = found.histogram.counts if found.histogram else ()
    assert sum(counts) == len(finite)
    assert found.not_finite == len(values) - len(finite)
