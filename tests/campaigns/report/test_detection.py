"""Detection curves and limits, against simulated truth."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.campaigns import Outcome
from rtf.campaigns.report.detection import Curve, detection_curves
from rtf.testing.verdict import Verdict
from simulated_truth import Truth, faulty, outcome

SEVERITIES = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0)


def curve(outcomes: list[Outcome]) -> Curve:
    """Return the only curve."""
    (found,) = detection_curves(outcomes, lambda _: "deg")
    return found


def test_the_limit_is_near_the_truth():
    """With many runs the severity of which 99 % are found is that of the true curve."""
    truth = Truth()
    found = curve(truth.campaign(np.random.default_rng(1), SEVERITIES, 1000))
    assert found.method == "logistic"
    assert found.limit.severity == pytest.approx(truth.limit, rel=0.05)
    assert found.limit.low is not None
    assert found.limit.high is not None
    assert found.limit.low < truth.limit < found.limit.high
    for point in found.points:
        assert point.low <= point.share <= point.high
        assert point.share == pytest.approx(float(truth.share(point.severity)), abs=0.02)


def test_the_interval_of_the_limit_covers_the_truth():
    """In about 95 of 100 campaigns of ordinary size."""
    truth, random = Truth(), np.random.default_rng(3)
    curves = [curve(truth.campaign(random, SEVERITIES, 12)) for _ in range(100)]
    known = [one.limit for one in curves if one.method == "logistic"]
    assert len(known) > 85
    inside = [(one.low or 0.0) <= truth.limit and (one.high is None or truth.limit <= one.high) for one in known]
    assert 0.91 <= np.mean(inside) <= 0.99


def test_severities_that_were_drawn_are_shown_in_groups():
    """Each severity was tried once; the curve uses all of them, and the levels are eight groups."""
    random = np.random.default_rng(5)
    truth = Truth()
    found = curve(truth.campaign(random, [float(one) for one in random.uniform(0.2, 4.0, 400)], 1))
    assert (found.method, len(found.levels), sum(level.found.trials for level in found.levels)) == ("logistic", 8, 400)
    assert all(level.least < level.severity < level.greatest for level in found.levels)
    assert found.limit.severity == pytest.approx(truth.limit, rel=0.4)


def test_many_severities_that_were_chosen_are_levels():
    """Twenty severities with five runs each are not put into groups; and a steep curve is drawn where it rises."""
    random, severities = np.random.default_rng(8), [0.9 + 0.01 * step for step in range(20)]
    found = curve(Truth(middle=1.0, steepness=60.0).campaign(random, severities, 5))
    assert [level.severity for level in found.levels] == severities
    assert sum(0.05 < point.share < 0.95 for point in found.points) > 10


def test_a_severity_that_was_chosen_is_a_level_of_exactly_this_size():
    """The mean of five times 0.014 is another number."""
    found = curve([faulty(0.014, found=False, unit=unit) for unit in range(5)])
    assert found.levels[0].severity == 0.014


SEPARATED = [faulty(size, found=size > 1.2, unit=unit) for size in (0.5, 1.0, 1.5, 2.0) for unit in range(10)]


def test_a_clean_step_has_exact_levels():
    """Nothing below 1.2, all above: no curve; the limit is the first level of which all were found, and no number."""
    found = curve(SEPARATED)
    assert found.method == "levels"
    assert "separates" in found.reason
    assert (found.limit.severity, found.limit.low, found.limit.high) == (1.5, 1.0, None)
    assert [(level.severity, level.found.count, level.found.trials) for level in found.levels] == [
        (0.5, 0, 10),
        (1.0, 0, 10),
        (1.5, 10, 10),
        (2.0, 10, 10),
    ]


def test_so_many_runs_without_a_miss_bound_the_limit():
    """Of 400 runs none was missed: the true share there is at least 99 %."""
    found = curve([faulty(size, found=size > 1.2, unit=unit) for size in (1.0, 1.5) for unit in range(400)])
    assert (found.limit.severity, found.limit.high) == (1.5, 1.5)


@pytest.mark.parametrize(
    ("outcomes", "reason", "limit"),
    [
        ([faulty(1.0, found=True), faulty(2.0, found=True)], "all were found", 1.0),
        ([faulty(1.0, found=False), faulty(2.0, found=False)], "none was found", None),
        ([faulty(1.0, found=True), faulty(1.0, found=False)], "1 severity", None),
        ([faulty(0.0, found=False)], "no severity", None),
        (
            [faulty(size, found=unit < hits, unit=unit) for size, hits in ((1.0, 5), (2.0, 2)) for unit in range(8)],
            "not found more often",
            None,
        ),
    ],
)
def test_the_reason_is_reported_where_there_is_no_curve(outcomes: list[Outcome], reason: str, limit: float | None):
    """What was tried does not decide where the curve is; the levels stand for themselves."""
    found = curve(outcomes)
    assert (found.method, found.limit.severity) == ("levels", limit)
    assert reason in found.reason


def test_both_directions_have_a_curve():
    """Too much and too little are faults of their own; sizes have no sign."""
    outcomes = [faulty(size, found=size < 0) for size in (-2.0, -1.0, 1.0, 2.0)]
    curves = detection_curves(outcomes, lambda _: "")
    assert [(one.direction, one.found.share, [level.severity for level in one.levels]) for one in curves] == [
        ("-", 1.0, [1.0, 2.0]),
        ("+", 0.0, [1.0, 2.0]),
    ]


def test_a_fault_without_a_size_has_a_rate():
    """It is found or not; there is no curve and no limit."""
    found = curve([faulty(None, found=True), faulty(None, found=True), faulty(None, found=False)])
    assert (found.method, found.reason, found.levels, found.limit.severity) == ("rate", "", (), None)
    assert found.found.count == 2


def test_only_runs_that_judged_count():
    """An error or an inconclusive run says neither that the fault was found nor that it was not; it is counted."""
    verdicts = [Verdict.ERROR, Verdict.INCONCLUSIVE, Verdict.BLOCKED]
    unable = [outcome(one, fault="encoder_drift", joint="l_elbow", severity=1.0) for one in verdicts]
    found = curve([*unable, faulty(1.0, found=True), faulty(2.0, found=True)])
    assert (found.runs, found.found.trials, found.levels[0].found.trials) == (5, 2, 1)


@pytest.mark.parametrize(
    ("named", "right"),
    [("l_elbow", 1), ("left_arm/l_elbow", 1), ("left_arm l_elbow", 1), ("l_wrist_pitch", 0), (None, 0), ("elbow", 0)],
)
def test_the_right_joint_is_named(named: str | None, right: int):
    """By the subject of the first failure, which may have the part before the joint; what was not found names none."""
    found = curve([faulty(1.0, found=True, named=named), faulty(1.0, found=False, named="l_elbow")])
    assert (found.right_joint.count, found.right_joint.trials) == (right, 1)


def test_joints_are_told_apart():
    """A curve is of all joints; which of them hide the fault is reported beside it."""
    found = curve([faulty(1.0, found=joint == "l_elbow", joint=joint) for joint in ("l_elbow", "r_knee", "l_elbow")])
    assert [(one.joint, one.found.count, one.found.trials) for one in found.joints] == [
        ("l_elbow", 2, 2),
        ("r_knee", 0, 1),
    ]


@given(
    st.lists(
        st.tuples(st.floats(1e-6, 1e6), st.booleans(), st.sampled_from(Verdict)),
        min_size=1,
        max_size=60,
    )
)
def test_any_outcomes_have_a_curve_or_a_reason(rows: list[tuple[float, bool, Verdict]]):
    """No error and no number that is none, whatever was found."""
    outcomes = [outcome(verdict, fault="jam", joint="l_elbow", severity=size) for size, _, verdict in rows]
    outcomes += [faulty(size, found=hit, fault="jam") for size, hit, _ in rows]
    found = curve(outcomes)
    assert found.method == "logistic" or found.reason
    numbers = [found.limit.severity, found.limit.low, found.limit.high]
    numbers += [number for point in found.points for number in (point.severity, point.low, point.share, point.high)]
    assert all(number is None or np.isfinite(number) for number in numbers)
    if found.method == "logistic" and None not in (found.limit.low, found.limit.severity):
        assert found.limit.low <= found.limit.severity  # type: ignore[operator]
