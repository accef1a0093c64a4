"""Comparison of two campaigns, against simulated truth."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.campaigns import Measured, Outcome
from rtf.campaigns.report.comparison import Comparison, compare, exact_p
from rtf.campaigns.report.summary import make_report
from rtf.testing.verdict import Verdict
from simulated_truth import Truth, faulty, measured, outcome

SEVERITIES = [0.25, 0.5, 1.0, 2.0, 4.0]


def compared(before: list[Outcome], after: list[Outcome]) -> Comparison:
    """Return the comparison of two campaigns with these outcomes."""
    return compare(make_report(before, "before"), make_report(after, "after"), before, after)


def population(random: np.random.Generator, shift: float) -> list[Outcome]:
    """Return outcomes of thirty units with thirty measurements, one of which may have moved."""
    return [
        outcome(
            unit=unit,
            measurements={
                f"joint {joint}/error": Measured(float(random.normal(shift if joint == 7 else 0.0, 1.0)), "deg")
                for joint in range(30)
            },
        )
        for unit in range(30)
    ]


@st.composite
def counts(draw: st.DrawFn) -> tuple[int, int, int, int]:
    """Found and tried before, found and tried after."""
    tried, later = draw(st.integers(1, 30)), draw(st.integers(1, 30))
    return draw(st.integers(0, tried)), tried, draw(st.integers(0, later)), later


@given(counts())
def test_one_stratum_is_fishers_test(stratum: tuple[int, int, int, int]):
    """The p value is that of SciPy."""
    from scipy.stats import fisher_exact  # here, as each process that collects tests would load it for a second

    hits, tried, later_hits, later = stratum
    expected = fisher_exact([[hits, tried - hits], [later_hits, later - later_hits]]).pvalue
    assert exact_p([stratum]) == pytest.approx(expected, abs=1e-9)


@given(st.lists(counts(), min_size=1, max_size=6))
def test_strata_are_compared_each_with_itself(strata: list[tuple[int, int, int, int]]):
    """The order does not matter, before and after may be exchanged, and it is a probability."""
    p = exact_p(strata)
    assert 0.0 < p <= 1.0
    assert exact_p(strata[::-1]) == pytest.approx(p, rel=1e-6)
    assert exact_p([(later_hits, later, hits, tried) for hits, tried, later_hits, later in strata]) == pytest.approx(
        p, rel=1e-6
    )


def test_chance_differences_are_as_rare_as_promised():
    """Of two campaigns with the same truth p is below 5 % at most one time in twenty."""
    random = np.random.default_rng(1)
    draws = random.binomial(10, [0.1, 0.5, 0.9], size=(800, 2, 3))
    values = [exact_p([(int(one[k]), 10, int(other[k]), 10) for k in range(3)]) for one, other in draws]
    assert np.mean(np.array(values) <= 0.05) <= 0.06


def test_a_detection_limit_that_moved_is_found():
    """The new firmware hides small faults: the shares at equal severities differ, and both limits are reported."""
    random = np.random.default_rng(2)
    changes = compared(
        Truth(middle=0.6).campaign(random, SEVERITIES, 30), Truth(middle=1.2).campaign(random, SEVERITIES, 30)
    ).changes
    (change,) = [one for one in changes if one.what == "detection"]
    assert (change.test, change.subject, change.significant) == ("Sweep", "encoder_drift", True)
    assert change.before > change.after
    assert change.limits is not None
    assert None not in change.limits
    assert change.limits[0] < change.limits[1]  # type: ignore[operator]


def test_a_measurement_that_moved_is_found_among_those_that_did_not():
    """In each of ten comparisons; and of what is reported about one in twenty is chance, not of what is compared."""
    random = np.random.default_rng(3)
    chance = []
    for _ in range(10):
        changes = compared(population(random, 0.0), population(random, 2.0)).changes
        significant = [change.subject for change in changes if change.significant]
        assert significant[0] == "joint 7/error"
        chance.append((len(significant) - 1) / len(significant))
    assert np.mean(chance) <= 0.15


def test_a_spread_that_grew_is_a_change():
    """The medians are equal; the distribution is not."""
    random = np.random.default_rng(4)
    changes = compared(measured(random.normal(0.0, 1.0, 100)), measured(random.normal(0.0, 4.0, 100))).changes
    assert [change.significant for change in changes if change.what == "distribution"] == [True]


def test_false_alarms_and_wrong_joints_are_compared():
    """By Fisher's exact test."""
    before = [outcome(unit=unit) for unit in range(40)] + [faulty(1.0, found=True, unit=unit) for unit in range(40)]
    after = [outcome(Verdict.FAILED if unit < 15 else Verdict.PASSED, unit=unit) for unit in range(40)]
    after += [faulty(1.0, found=True, unit=unit, named="l_elbow" if unit > 20 else "torso_yaw") for unit in range(40)]
    changes = {change.what: change for change in compared(before, after).changes}
    assert (changes["false alarms"].before, changes["false alarms"].after) == (0.0, 0.375)
    assert changes["false alarms"].significant
    assert changes["right joint"].significant
    assert not changes["detection"].significant


def test_what_one_of_them_has_is_reported():
    """Nothing is compared where there is nothing in common: other tests, other severities."""
    found = compared([outcome(test="A"), faulty(1.0, found=True)], [outcome(test="B"), faulty(2.0, found=True)])
    assert found.only_before == ("A on a healthy icub",)
    assert found.only_after == ("B on a healthy icub",)
    assert [change.what for change in found.changes] == ["right joint"]


def test_a_campaign_is_like_itself():
    """Nothing differs."""
    same = [*population(np.random.default_rng(5), 0.0), *Truth().campaign(np.random.default_rng(6), SEVERITIES, 8)]
    assert not any(change.significant for change in compared(same, same).changes)


def test_nothing_is_compared_without_outcomes():
    """Two empty campaigns have no difference."""
    assert compared([], []).changes == ()
