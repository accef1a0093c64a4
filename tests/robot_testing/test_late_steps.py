"""What a step test says of steps that its own loop did not keep up with, or that noise hides, and which it refuses."""

from types import SimpleNamespace

import numpy as np
import pytest

from rtf.robot_testing import step_test
from rtf.robot_testing.robot_test import RobotTest
from rtf.robot_testing.step_test import Cycle, StepTest
from rtf.testing.verdict import Inconclusive, MeasurementVerdict, TestProblem

from .kept_test import kept_test

LATE = "the loop of this test was suspended for 39 ms"


class Judging(StepTest):
    """A step test of one joint that has been stepped; it keeps what it measures, and with what limit."""

    plugin_name = "judging"

    def measure(self, name, value, unit="", low=None, high=None, hint=""):
        """Keep it."""
        self.measured_values[name] = high
        wrong = high is not None and value > high
        self.failed |= wrong
        return SimpleNamespace(verdict=MeasurementVerdict.FAILED if wrong else MeasurementVerdict.PASSED)

    def check_fail_if_true(self, condition, text):
        """Keep it."""
        self.failed |= condition
        self.reports.append(text)

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


def still(late=""):
    """One that is not answered."""
    step = cycle(0.0, late)
    return step._replace(measured=np.zeros_like(step.measured))


def noisy(step, deviation, seed):
    """The same, measured by a sensor with white noise."""
    noise = np.random.default_rng(seed).normal(0.0, deviation, step.time.size)
    return step._replace(measured=step.measured + noise)


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
    """What was measured is reported without its limits."""
    with pytest.raises(Inconclusive, match=r"elbow: overshoot is 50 %; but the loop of this test was suspended"):
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
    with pytest.raises(Inconclusive, match=r"4 a second.*; but the loop of this test was suspended"):
        judging._judge_number_of_states(0, np.arange(-0.5, 2.0, 0.25), LATE)


def test_a_late_step_that_never_came_says_nothing(judging):
    """A value that is not there is wrong as well."""
    with pytest.raises(Inconclusive, match=r"there is no delay, there is no rise time.*; but the loop of this test"):
        judging.judge(0, [still(LATE)])
    judging.judge(0, [still(LATE), cycle(0.0)])
    assert not judging.failed
    judging.judge(0, [still(), cycle(0.0)])
    assert judging.failed


def test_a_step_with_values_that_are_no_numbers_says_nothing(judging):
    """Whatever the other values are."""
    broken = cycle(0.5)
    broken.measured[100] = np.nan
    with pytest.raises(Inconclusive, match="elbow: 1 of 440 measured values are not finite"):
        judging.judge(0, [broken, cycle(0.0)])
    assert judging.measured_values == {}


@pytest.mark.parametrize("deviation", [0.02, 0.05, 0.1])
def test_noise_is_not_held_against_a_joint(judging, deviation):
    """As long as it is no more than the ripple that is allowed."""
    judging.ripple = judging.repeatability = 0.15
    judging.judge(0, [noisy(cycle(0.0), deviation, seed) for seed in range(3)])
    assert not judging.failed


@pytest.mark.parametrize("deviation", [0.0, 0.05, 0.1])
def test_a_joint_that_does_not_answer_is_found_in_noise(judging, deviation):
    """Noise makes no answer."""
    judging.judge(0, [noisy(still(), deviation, seed) for seed in range(3)])
    assert judging.failed


def test_a_step_in_a_noise_that_hides_it_says_nothing(judging):
    """Neither that the joint answers nor that it does not; but for the noise, where that is wrong itself."""
    judging.ripple = judging.repeatability = 1.0
    with pytest.raises(Inconclusive, match=r"elbow: a step of 1 deg is not visible in a noise of 0\.\d+ deg"):
        judging.judge(0, [noisy(cycle(0.0), 0.4, seed) for seed in range(3)])
    assert not judging.failed
    judging.ripple = 0.1
    with pytest.raises(Inconclusive):
        judging.judge(0, [noisy(cycle(0.0), 0.4, seed) for seed in range(3)])
    assert judging.failed


def test_no_limit_excuses_a_quarter_of_a_step(judging):
    """A low step is as easily missed as a high one."""
    judging.band = judging.steady_error = 0.1
    low = cycle(0.0)
    judging.judge(0, [low._replace(target=0.04, measured=0.04 * low.measured)])
    assert not judging.failed
    assert judging.measured_values["steady error"] == pytest.approx(0.01)
    judging.judge(0, [low._replace(target=0.04, measured=0.025 * low.measured)])
    assert judging.failed


class Chosen(Exception):
    """The joints are chosen, which is what a test does next."""


@pytest.mark.parametrize("simulated", [True, False])
@pytest.mark.parametrize(
    ("name", "height", "most"),
    [
        ("PositionControlAccuracy", 5.5, "5 deg"),
        ("PositionControlAccuracyExternalPid", 5.5, "5 deg"),
        ("TorqueControlAccuracy", 1.2, "1 Nm"),
    ],
)
def test_a_step_that_would_throw_a_joint_is_refused(monkeypatch, name, height, most, simulated):
    """On a part that is no simulated one, before anything moves; it is named which parameter it is, and the hint."""

    def choose(part):
        raise Chosen

    test = kept_test(name, robot_name="bot", network=None, open_part=lambda name: None, choose=choose)
    monkeypatch.setattr(RobotTest, "setup", lambda self: None)
    monkeypatch.setattr(step_test, "is_simulated", lambda *_: simulated)
    test.resolve_parameters(param=f"--step {height}")
    with pytest.raises(Chosen if simulated else TestProblem) as refused:
        test.setup()
    if not simulated:
        assert str(refused.value).startswith(f"step is {height} ")
        assert str(refused.value).endswith(f"; give {most} or less")
    test.step = float(most.split()[0])
    with pytest.raises(Chosen):
        test.setup()
