"""False alarms and flakiness on healthy robots."""

from __future__ import annotations

import numpy as np
import pytest

from rtf.campaigns import Measured
from rtf.campaigns.report.healthy import Steadiness, false_alarms, flakiness
from rtf.testing.verdict import Verdict
from simulated_truth import faulty, outcome

PASSED, FAILED = Verdict.PASSED, Verdict.FAILED


@pytest.mark.parametrize("alarm", [FAILED, Verdict.ERROR])
def test_false_alarms_are_failures_and_errors_on_healthy_robots(alarm: Verdict):
    """Faulty robots do not count, nor runs that judged nothing, which are counted apart."""
    outcomes = [
        *[outcome(PASSED, unit=unit) for unit in range(18)],
        outcome(alarm, unit=18),
        outcome(Verdict.BLOCKED, unit=19),
        outcome(Verdict.INCONCLUSIVE, unit=19),
        faulty(1.0, found=True),
    ]
    (found,) = false_alarms(outcomes)
    assert (found.runs, found.units, found.alarms.count, found.alarms.trials, found.unjudged) == (21, 20, 1, 19, 2)
    assert (found.alarms.low, found.alarms.high) == (pytest.approx(0.0013, abs=1e-4), pytest.approx(0.2603, abs=1e-4))


def test_a_test_that_always_says_the_same_is_stable():
    """Also when it always fails one of the units: that is a false alarm, and not flaky."""
    outcomes = [outcome(FAILED if unit == 3 else PASSED, unit=unit, seed=seed) for unit in range(6) for seed in (1, 2)]
    (found,) = flakiness(outcomes)
    assert (found.verdict, found.differing.count, found.differing.trials) == (Steadiness.STABLE, 0, 6)


def test_units_that_were_tested_once_say_nothing():
    """Two units may differ; only two runs of one unit can be compared."""
    (found,) = flakiness([outcome(PASSED, unit=1), outcome(FAILED, unit=2)])
    assert (found.verdict, found.differing.trials) == (Steadiness.UNKNOWN, 0)


def test_a_change_that_no_value_explains_is_flaky():
    """The measurement was far inside its limits, and the test failed nevertheless."""
    inside = {"l_elbow/error": Measured(0.5, "deg", None, 1.0)}
    outcomes = [outcome(verdict, seed=seed, measurements=inside) for seed, verdict in enumerate([PASSED, FAILED] * 2)]
    (found,) = flakiness(outcomes)
    assert (found.verdict, found.differing.count, found.measurement) == (Steadiness.FLAKY, 2, "")


def test_a_value_near_its_limit_is_marginal():
    """The failed runs are out of their limits by less than the value varies anyhow."""
    values = np.random.default_rng(2).normal(1.0, 0.1, 40)
    outcomes = [
        outcome(
            FAILED if value > 1.0 else PASSED,
            seed=seed,
            measurements={"l_elbow/error": Measured(value, "deg", None, 1.0), "other": Measured(1.0, "", None, 2.0)},
        )
        for seed, value in enumerate(values)
    ]
    (found,) = flakiness(outcomes)
    assert (found.verdict, found.measurement) == (Steadiness.MARGINAL, "l_elbow/error")
    assert found.differing.trials == 20


@pytest.mark.parametrize("value", [50.0, float("nan"), float("inf")])
def test_a_glitch_is_flaky(value: float):
    """A value far out of its limits, or no number, is no matter of a tight limit."""
    values = [1.0, 1.02, 0.98, 1.01, 0.99, value]
    outcomes = [
        outcome(
            FAILED if not one <= 1.1 else PASSED, seed=seed, measurements={"error": Measured(one, "deg", None, 1.1)}
        )
        for seed, one in enumerate(values)
    ]
    (found,) = flakiness(outcomes)
    assert (found.verdict, found.differing.count) == (Steadiness.FLAKY, 1)


def test_a_second_attempt_is_a_change_of_verdict():
    """A flaky run failed first, unlike the other run of this unit, which passed at once."""
    (found,) = flakiness([outcome(PASSED, seed=1), outcome(Verdict.FLAKY, seed=2, attempts=2)])
    assert (found.verdict, found.differing.count) == (Steadiness.FLAKY, 1)


def test_the_rate_is_that_of_the_truth():
    """A test that fails a healthy robot in 20 % of the runs differs in 32 % of the pairs; the interval has it."""
    random = np.random.default_rng(4)
    outcomes = [outcome(FAILED if random.random() < 0.2 else PASSED, seed=seed) for seed in range(2000)]
    (found,) = flakiness(outcomes)
    assert found.differing.trials == 1000
    assert found.differing.low < 0.32 < found.differing.high
