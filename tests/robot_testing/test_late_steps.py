"""What a step test says of steps that its own loop did not keep up with."""

from types import SimpleNamespace

import numpy as np
import pytest

from rtf.robot_testing.steps import Cycle, StepTest
from rtf.testing.outcome import Inconclusive, TestProblem
from rtf.testing.verdict import MeasurementVerdict

LATE = "the loop of this test stood still for 39 ms"


class Judging(StepTest):
    """A step test of one joint that has been stepped; it keeps what it measures, and with what limit."""

    plugin_name = "judging"

    def measure(self, name, value, unit="", low=None, high=None, hint=""):
        """Keep it."""
        self.measured_values[name] = high
        wrong = high is not None and value > high
        self.failed |= wrong
        return SimpleNamespace(verdict=MeasurementVerdict.FAILED if wrong else MeasurementVerdict.PASSED)

    def report(self, *texts):
        """Keep it."""
        self.reports += texts


@pytest.fixture
def judging():
    """One that has not judged anything yet."""
    test = Judging()
    test.robot_name, test.robot_part = "bot", SimpleNamespace(name="left_arm", names=["elbow"])
    test.measured_values, test.reports, test.failed = {}, [], False
    return test


def cycle(beyond, late=""):
    """A step of one degree that goes beyond its target by a share, and comes back."""
    time = np.arange(-0.2, 2.0, 0.01)
    measured = np.clip(time / 0.1, 0.0, 1.0) + beyond * ((time > 0.1) & (time < 0.2))
    return Cycle(time, measured, np.where(time < 0, 0.0, 1.0), 0.0, 1.0, 0, np.zeros(1), late)


def test_a_late_step_within_its_limits_counts(judging):
    """To be late makes no answer better."""
    judging.judge(0, [cycle(0.0, LATE), cycle(0.0)])
    assert not judging.failed
    assert judging.measured_values["overshoot"] == judging.overshoot
    assert "repeatability" in judging.measured_values


def test_a_late_step_beyond_them_is_left_to_those_in_time(judging):
    """Which are judged as ever, and it is said that one is not."""
    judging.judge(0, [cycle(0.5, LATE), cycle(0.0)])
    assert not judging.failed
    assert any("1 of 2 steps are not judged" in text for text in judging.reports)
    judging.judge(0, [cycle(0.5, LATE), cycle(0.5)])
    assert judging.failed


def test_without_any_step_in_time_nothing_can_be_said(judging):
    """What was measured is told without its limits."""
    with pytest.raises(Inconclusive, match=r"elbow: overshoot is 50 %; but the loop of this test stood still"):
        judging.judge(0, [cycle(0.5, LATE)])
    assert not judging.failed
    assert set(judging.measured_values.values()) == {None}


def test_a_step_of_which_too_few_states_came_cannot_be_judged(judging):
    """It is named which stream is too slow, and how fast it is: nothing is wrong with the controller."""
    came = np.arange(-0.5, 2.0, 0.25)
    with pytest.raises(TestProblem) as problem:
        judging._judge_number_of_states(0, came, "")
    said = (
        "/bot/left_arm/stateExt:o: 10 states came, 4 a second, 8 of them after the step of elbow, up to 1.75 s after it"
    )
    assert str(problem.value).startswith(f"{said}; ")
    assert "likely: a wrong period" in str(problem.value)
    with pytest.raises(TestProblem, match=r"0 states came, 0 a second, 0 of them after the step of elbow; \d+ are"):
        judging._judge_number_of_states(0, np.empty(0), "")


def test_too_few_states_for_a_test_that_was_late_say_nothing(judging):
    """They may have come while this machine stood still."""
    with pytest.raises(Inconclusive, match=r"4 a second.*; but the loop of this test stood still"):
        judging._judge_number_of_states(0, np.arange(-0.5, 2.0, 0.25), LATE)
