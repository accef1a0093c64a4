"""Step tests: steps that the test commanded late, steps hidden by noise, and steps that are refused."""

from types import SimpleNamespace

import numpy as np
import pytest

from rtf.robot.model import default_robot
from rtf.robot_testing import step_test
from rtf.robot_testing.robot_test import RobotTest
from rtf.robot_testing.step_test import Cycle, StepTest
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.verdict import Inconclusive, TestProblem

from .kept_test import kept_test

LATE = "the loop of this test was suspended for 39 ms"


class Judging(StepTest):
    """A step test of one joint with recorded steps; it keeps its measurements and their limits."""

    plugin_name = "judging"

    def measure(self, name, value, unit="", low=None, high=None, hint=""):
        """Keep the measurement."""
        self.measured_values[name] = high
        wrong = high is not None and value > high
        self.failed |= wrong
        return SimpleNamespace(verdict=MeasurementVerdict.FAILED if wrong else MeasurementVerdict.PASSED)

    def check_fail_if_true(self, condition, text):
        """Keep the failure."""
        self.failed |= condition
        self.reports.append(text)

    def report(self, *texts):
        """Keep the report."""
        self.reports += texts


@pytest.fixture
def judging(monkeypatch):
    """A step test that has not judged yet; nothing disturbs its joint."""
    monkeypatch.setattr("rtf.robot_testing.step_test.disturbance", lambda *_: "")
    test = Judging()
    test.robot_name, test.robot_part = "bot", SimpleNamespace(name="left_arm", names=["elbow"], board=None, guard=None)
    test.measured_values, test.reports, test.failed = {}, [], False
    return test


def cycle(beyond, late=""):
    """Return a step of one degree and back, with this overshoot."""
    time = np.arange(-0.2, 2.0, 0.01)
    measured = np.clip(time / 0.1, 0.0, 1.0) + beyond * ((time > 0.1) & (time < 0.2))
    return Cycle(time, measured, np.where(time < 0, 0.0, 1.0), 0.0, 1.0, 0, np.zeros(1), late)


def still(late=""):
    """Return a step without a response."""
    step = cycle(0.0, late)
    return step._replace(measured=np.zeros_like(step.measured))


def noisy(step, deviation, seed):
    """Return the same step, measured with white noise."""
    noise = np.random.default_rng(seed).normal(0.0, deviation, step.time.size)
    return step._replace(measured=step.measured + noise)


def test_a_late_step_within_its_limits_counts(judging):
    """A delay makes no response better."""
    judging.judge(0, [cycle(0.0, LATE), cycle(0.0)])
    assert not judging.failed
    assert judging.measured_values["overshoot"] == judging.overshoot
    assert "repeatability" in judging.measured_values


def test_a_late_step_beyond_its_limits_does_not_count(judging):
    """The steps in time are judged, and the late one is reported."""
    judging.judge(0, [cycle(0.5, LATE), cycle(0.0)])
    assert not judging.failed
    assert any("1 of 2 steps are not judged" in text for text in judging.reports)
    judging.judge(0, [cycle(0.5, LATE), cycle(0.5)])
    assert judging.failed


def test_without_any_step_in_time_the_result_is_inconclusive(judging):
    """The measurements are recorded without limits."""
    with pytest.raises(Inconclusive, match=r"elbow: overshoot is 50 %; but the loop of this test was suspended"):
        judging.judge(0, [cycle(0.5, LATE)])
    assert not judging.failed
    assert set(judging.measured_values.values()) == {None}


def test_a_step_with_too_few_states_cannot_be_judged(judging):
    """The message has the slow stream and its rate; the controller does not fail."""
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


def test_too_few_states_of_a_late_test_are_inconclusive(judging):
    """They may have arrived while the process was suspended."""
    with pytest.raises(Inconclusive, match=r"4 a second.*; but the loop of this test was suspended"):
        judging._judge_number_of_states(0, np.arange(-0.5, 2.0, 0.25), LATE)


def test_a_late_step_without_a_response_is_inconclusive(judging):
    """A missing characteristic is beyond its limit, too."""
    with pytest.raises(Inconclusive, match=r"there is no delay, there is no rise time.*; but the loop of this test"):
        judging.judge(0, [still(LATE)])
    judging.judge(0, [still(LATE), cycle(0.0)])
    assert not judging.failed
    judging.judge(0, [still(), cycle(0.0)])
    assert judging.failed


def test_a_step_with_values_that_are_not_finite_is_not_judged(judging):
    """Whatever the other values are."""
    broken = cycle(0.5)
    broken.measured[100] = np.nan
    with pytest.raises(Inconclusive, match="elbow: 1 of 440 measured values are not finite"):
        judging.judge(0, [broken, cycle(0.0)])
    assert judging.measured_values == {}


@pytest.mark.parametrize("deviation", [0.02, 0.05, 0.1])
def test_noise_within_the_allowed_ripple_passes(judging, deviation):
    """It does not count as overshoot or ripple."""
    judging.ripple = judging.repeatability = 0.15
    judging.judge(0, [noisy(cycle(0.0), deviation, seed) for seed in range(3)])
    assert not judging.failed


def test_the_noise_that_a_sensor_has_by_the_robots_description_is_no_ripple(judging):
    """The limits are those of the answer: variances of the sensor come on top, and no more than these."""
    judging.ripple = judging.repeatability = 0.05
    judging.sensor_noise = lambda _joint: 0.05
    judging.judge(0, [noisy(cycle(0.0), 0.05, seed) for seed in range(3)])
    assert not judging.failed
    judging.judge(0, [noisy(cycle(0.0), 0.15, seed) for seed in range(3)])
    assert judging.failed


@pytest.mark.parametrize("deviation", [0.0, 0.05, 0.1])
def test_a_missing_response_is_found_in_noise(judging, deviation):
    """Noise is no response."""
    judging.judge(0, [noisy(still(), deviation, seed) for seed in range(3)])
    assert judging.failed


def test_a_step_hidden_by_noise_is_inconclusive(judging):
    """Whether the joint responds is unknown; noise beyond its own limit is a failure."""
    judging.ripple = judging.repeatability = 1.0
    with pytest.raises(Inconclusive, match=r"elbow: a step of 1 deg is not visible in a noise of 0\.\d+ deg"):
        judging.judge(0, [noisy(cycle(0.0), 0.4, seed) for seed in range(3)])
    assert not judging.failed
    judging.ripple = 0.1
    with pytest.raises(Inconclusive):
        judging.judge(0, [noisy(cycle(0.0), 0.4, seed) for seed in range(3)])
    assert judging.failed


def test_a_quarter_of_a_step_is_always_a_failure(judging):
    """Small steps are as demanding as large ones."""
    judging.band = judging.steady_error = 0.1
    low = cycle(0.0)
    judging.judge(0, [low._replace(target=0.04, measured=0.04 * low.measured)])
    assert not judging.failed
    assert judging.measured_values["steady error"] == pytest.approx(0.01)
    judging.judge(0, [low._replace(target=0.04, measured=0.025 * low.measured)])
    assert judging.failed


class Chosen(Exception):
    """The joints were selected, which is the next step of a test."""


@pytest.mark.parametrize("simulated", [True, False])
@pytest.mark.parametrize(
    ("name", "height", "most"),
    [
        ("PositionControlAccuracy", 5.5, "5 deg"),
        ("PositionControlAccuracyExternalPid", 5.5, "5 deg"),
        ("TorqueControlAccuracy", 1.2, "1 Nm"),
    ],
)
def test_a_dangerous_step_is_refused(monkeypatch, name, height, most, simulated):
    """On a real part, before anything moves; the message has the parameter and the remedy."""

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


def test_steps_of_one_direction_are_compared_with_each_other(judging):
    """An offset that those up and those down have in common is judged by other values."""
    up = cycle(0.0)
    down = up._replace(measured=0.4 - up.measured, commanded=-up.commanded, target=-1.0)
    judging.steady_error = judging.band = 0.5
    values = {one.name: one for one in judging.values(0, [up._replace(measured=up.measured + 0.4), down, down])}
    assert values["repeatability"].value == pytest.approx(0.0, abs=1e-9)
    apart = {one.name: one for one in judging.values(0, [up, down, up._replace(measured=up.measured + 0.4)])}
    assert apart["repeatability"].wrong
    assert "repeatability" not in {one.name for one in judging.values(0, [up, down])}


@pytest.mark.parametrize(("held", "most"), [(0.5, 0.2), (6.0, 0.6), (-6.0, 0.6)])
def test_before_a_torque_step_the_tolerance_of_the_torque_constant_is_allowed(held, most):
    """A tenth of what the motors of the joint carry, or the parameter if that is more."""
    test = kept_test("TorqueControlAccuracy", _carried={0: abs(held)})
    test.robot_part = SimpleNamespace(names=["a joint that no model has"])
    step = cycle(0.0)
    step = step._replace(measured=held + 0.3 + 0.5 * step.measured, start=held, target=held + 0.5)
    error = test.values(0, [step])[0]
    assert (error.name, error.value, error.high) == ("error before the step", pytest.approx(0.3), pytest.approx(most))


def test_torque_sensors_have_the_noise_of_the_model():
    """A share of the greatest torque of the joint; none of a joint that the model does not have."""
    test = kept_test("TorqueControlAccuracy")
    test.robot_part = SimpleNamespace(names=["torso_roll", "a joint that no model has"])
    robot = default_robot()
    most = robot.axes[robot.index["torso_roll"]].max_torque
    assert test.sensor_noise(0) == pytest.approx(0.001 * most)
    assert test.sensor_noise(1) == 0.0
