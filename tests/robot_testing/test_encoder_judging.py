"""The judgement of encoder tests, for known states."""

import math
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from rtf.robot_testing.duty_test import BothWays, Steps
from rtf.robot_testing.guard.transmission import Transmission
from rtf.robot_testing.motion.duty_ramp import End, Ramp
from rtf.robot_testing.motion.joint_swings import Outcome
from rtf.testing.verdict import Inconclusive, TestProblem

from .kept_test import kept_test

_TICK = 0.0879  # of an absolute encoder of 12 bits, deg
_GEAR = 100.0
_PERIOD = 0.01
PART = SimpleNamespace(names=["elbow"])
GEARED = Transmission(np.array([_GEAR]), np.eye(1), ((0,),))


class Trace(SimpleNamespace):
    """States with a number."""

    def __len__(self):
        return self.time.size


def trajectory(speed):
    """Return four half-swings of 20 deg and the way home, minimum-jerk with rests between, at this mean speed."""
    goals = [0.0, 10.0, -10.0, 10.0, -10.0, 0.0]
    moves = []
    for start, goal in pairwise(goals):
        share = np.linspace(0.0, 1.0, round(abs(goal - start) / speed / _PERIOD))
        moves += [start + (goal - start) * share**3 * (10 - 15 * share + 6 * share**2), np.full(10, goal)]
    return np.concatenate(moves)


def follow(motor, play):
    """Return the joint's position with this backlash: a dead band without any delay."""
    joint, places = motor[0], []
    for place in motor:
        joint = min(max(joint, place - play / 2), place + play / 2)
        places.append(joint)
    return np.array(places)


def swung(speed=20.0, play=0.0, delay=0.0):
    """Return the states of a joint that swings, with this delay (s) of its motor encoder."""
    motor = trajectory(speed)
    time = _PERIOD * np.arange(motor.size)
    joint = _TICK * np.round(follow(motor, play) / _TICK)
    shown = _GEAR * np.interp(time - delay, time, motor)
    return Trace(
        time=time,
        positions=joint[:, None],
        motor_positions=shown[:, None],
        velocities=np.gradient(motor, _PERIOD)[:, None],
        motor_velocities=np.gradient(shown, _PERIOD)[:, None],
        efforts=np.zeros((time.size, 1)),
    )


def consistency(trace):
    """Return OpticalEncodersConsistency after it has judged such swings of one joint."""
    test = kept_test("OpticalEncodersConsistency", robot_part=PART, transmission=GEARED, chosen=[0])
    test.swinger = SimpleNamespace(verdict=lambda joint, outcome: None)
    test._swings = {0: SimpleNamespace(trace=trace)}
    test._judge(0, Outcome(), trace)
    return test.kept


@pytest.mark.parametrize("speed", [20.0, 10.0, 5.0])
@pytest.mark.parametrize("play", [0.0, 0.4, 0.95])
def test_backlash_is_no_delay(speed, play):
    """Backlash within its limit is measured as such, however slow the joint is."""
    kept = consistency(swung(speed, play))
    assert kept.failures == []
    assert kept.values["play"] == pytest.approx(play, abs=0.05)
    assert kept.values["delay of the motor after the joint"] == pytest.approx(0.0, abs=3.0)


@pytest.mark.parametrize("delay", [-0.03, 0.03])
def test_a_delay_is_no_backlash(delay):
    """It is measured in spite of backlash; the failure names the late encoder and the likely causes."""
    kept = consistency(swung(8.0, 0.3, delay))
    assert kept.values["delay of the motor after the joint"] == pytest.approx(1e3 * delay, abs=3.0)
    (failure,) = kept.failures
    assert f"ms {'behind' if delay > 0 else 'ahead of'} the joint encoder; likely: " in failure


def test_a_wrong_speed_has_likely_causes():
    """The failure has the deviation."""
    trace = swung()
    trace.velocities = trace.velocities / 2
    (failure,) = consistency(trace).failures
    assert "elbow: by its positions the joint is 2.00 times as fast as its measured speed; likely: " in failure


@pytest.mark.parametrize("what", ["positions", "motor_positions", "velocities"])
def test_states_that_are_not_finite_end_their_joint(what):
    """They are counted, and no line is fitted to the rest."""
    trace = swung()
    getattr(trace, what)[[50, 70]] = math.nan
    with pytest.raises(TestProblem, match=r"elbow: 2 of \d+ states have no finite values of it; likely: "):
        consistency(trace)


def drift(apart):
    """Return OpticalEncodersDrift after it has judged these deviations, measured every six half-swings."""
    test = kept_test("OpticalEncodersDrift", robot_part=PART, transmission=GEARED, chosen=[0], complaints={})
    test.swinger = SimpleNamespace(verdict=lambda joint, outcome: None)
    test._judge(0, SimpleNamespace(swings=6.0 * np.arange(len(apart))), np.array(apart), 1.0)
    return test.kept


def test_a_significant_trend_fails():
    """With likely causes, although the final drift is within its limit."""
    apart = np.linspace(5.0, 5.19, 11)
    (failure,) = drift(apart).failures
    assert failure.startswith("drift by the trend, at least is 0.31")
    assert "elbow drifts by at least 0.317 deg in 100 half-swings, with a confidence of 99 %; likely: " in failure


def test_the_confidence_of_a_trend_holds_for_few_visits():
    """For pure noise six visits show a significant trend in one of a hundred runs."""
    random = np.random.default_rng(1)
    found = [drift([0.0, *random.normal(0.0, 0.05, 5)]).values["drift by the trend, at least"] for _ in range(300)]
    assert np.mean([value > 0 for value in found]) < 0.03


def test_a_visit_that_is_not_finite_ends_its_joint():
    """The joint is not judged; the number of such visits is in the message."""
    apart = np.linspace(5.0, 5.19, 11)
    for missing in (5, 0):
        with_gap = apart.copy()
        with_gap[missing] = math.nan
        with pytest.raises(TestProblem, match="elbow: at 1 of 11 visits of home its encoders"):
            drift(with_gap)


def test_a_joint_without_values_does_not_hide_the_drift_of_another():
    """The test still ends early."""
    rows = []
    part = SimpleNamespace(column=lambda _joint, degrees: (degrees, "deg"))
    test = kept_test("OpticalEncodersDrift", robot_part=part, chosen=[0, 1], complaints={})
    test._half_swings, test._visit = (lambda count: np.ones(2)), (lambda visits, done: None)
    test._apart = lambda visits: np.array([math.nan, 5.0])
    test._swing(None, SimpleNamespace(append=lambda *row: rows.append(row)))
    assert len(rows) == 1


def stiction(*values):
    """Return the results of MotorStiction for these break-away duty cycles in both directions."""
    ramps = [[Ramp(End.MOVED, value, sign * value, 5.0, 5.0, np.empty(0)) for sign in (1, -1)] for value in values]
    test = kept_test("MotorStiction", robot_part=PART, transmission=GEARED, chosen=[0], most=[10.0])
    test.steps = [Steps(0.0, 0.5, 0.1, 50.0, 5.0)]
    test.judge(0, [BothWays(*pair, held=True) for pair in ramps])
    return test.kept.failures


def test_the_stiction_of_few_repetitions_has_their_spread():
    """The confidence interval of two values would be a hundred times their difference."""
    (failure,) = stiction(11.5, 12.5)
    assert "elbow needs 12.0 % (11.5 to 12.5 in 2 times) of duty cycle beyond the load of gravity" in failure
    (failure,) = stiction(12.0)
    assert "elbow needs 12.0 % of duty cycle beyond" in failure


@pytest.mark.parametrize(("name", "settings"), [("MotorStiction", {"most": [10.0]}), ("MotorEncodersSignCheck", {})])
def test_a_joint_that_was_let_down_to_its_stop_is_not_accused(name, settings):
    """No duty cycle held it, so it fell; that it does not go on past its stop says nothing about its motor."""
    moved = Ramp(End.MOVED, 8.0, -8.0, -5.0, -5.0, np.empty(0))
    stuck = Ramp(End.MAXIMUM, 50.0, 50.0, 0.0, 0.0, np.empty(0))
    test = kept_test(name, robot_part=PART, transmission=GEARED, chosen=[0], **settings)
    test.steps = [Steps(0.0, 0.5, 0.1, 50.0, 5.0)]
    with pytest.raises(Inconclusive, match=r"elbow does not move with a positive duty cycle; but .* it was let down"):
        test.judge(0, [BothWays(stuck, moved, held=True, let_down=True)])
    assert not test.kept.failures


@pytest.mark.parametrize("column", ["positions", "motor_positions"])
def test_spikes_of_an_encoder_are_no_wrong_ratio(column):
    """Single states that are far off, of either encoder, are called spikes, and their number is in the message."""
    trace = swung()
    getattr(trace, column)[7::60] += 30.0 * (_GEAR if column == "motor_positions" else 1.0)
    kept = consistency(trace)
    assert kept.values["ratio to what is configured"] == pytest.approx(1.0, abs=0.005)
    noise, *_ = kept.failures
    assert "elbow: joint and motor disagree by" in noise
    assert "by spikes in" in noise
    assert not [failure for failure in kept.failures if "a stage of" in failure]


def test_a_noisy_joint_encoder_is_no_wrong_ratio():
    """Its noise makes the slope of the motor by the joint too small, and not that of the joint by the motor."""
    trace = swung()
    trace.positions = trace.positions + np.random.default_rng(2).normal(0.0, 3.0, trace.positions.shape)
    kept = consistency(trace)
    assert kept.values["ratio to what is configured"] == pytest.approx(1.0, abs=0.02)
    assert "elbow: joint and motor disagree by" in kept.failures[0]


def test_a_wrong_ratio_is_found_in_spite_of_spikes():
    """And the known stage is named."""
    trace = swung()
    trace.motor_positions = trace.motor_positions / 1.5
    trace.positions[7::60] += 30.0
    assert "times as far as configured: a stage of 1.5 too few in the mechanics" in consistency(trace).failures[0]
