"""MotorStiction on the simulated robot."""

import numpy as np
import pytest

from icub import AXES, INDEX
from robot_outcomes import said
from rtf.testing.events import SeriesRecorded
from rtf.testing.verdict import Verdict

ELBOW = '<parameter name="part">left_arm</parameter> <parameter name="joints">(3)</parameter>'
SUITE = f"""
<test name="healthy"> {ELBOW} MotorStiction </test>
<test name="dry"> {ELBOW} <parameter name="inject">"friction l_elbow"</parameter> <parameter name="repeat">1</parameter>
  <parameter name="outputStep">1</parameter> MotorStiction </test>
<test name="jammed"> {ELBOW} <parameter name="inject">"jam l_elbow"</parameter>
  <parameter name="outputMax">10</parameter> MotorStiction </test>
<test name="in-the-way"> {ELBOW} <parameter name="inject">"wrong_lower_limit l_elbow by=-14"</parameter>
  <parameter name="home">16</parameter> <parameter name="outputMax">10</parameter>
  <parameter name="repeat">1</parameter> MotorStiction </test>
<test name="right"> <parameter name="part">right_arm</parameter> <parameter name="joints">(2)</parameter>
  <parameter name="repeat">4</parameter> <parameter name="maxStiction">4.5</parameter> MotorStiction </test>
<test name="noisy"> {ELBOW} <parameter name="inject">"encoder_noise l_elbow"</parameter> MotorStiction </test>
<test name="backwards"> {ELBOW} <parameter name="outputStep">-1</parameter> MotorStiction </test>
"""


@pytest.fixture(scope="module")
def outcome(run_on_robot):
    """The suite above, run once."""
    return run_on_robot(SUITE, parts="left_arm,right_arm")


def test_the_stiction_is_the_friction_at_rest(outcome, measured):
    """Although the load of gravity is greater."""
    assert outcome.verdict("healthy") is Verdict.PASSED, outcome.detail("healthy")
    axis = AXES[INDEX["l_elbow"]]
    (found,) = measured(outcome, "healthy", "stiction")
    at_rest = axis.friction * (1 + axis.stribeck)
    assert found.value == pytest.approx(100 * at_rest / axis.max_torque, abs=1.2)  # the duty cycle grows in steps
    (gravity,) = measured(outcome, "healthy", "in the middle, against gravity")
    assert abs(gravity.value) > found.value


def test_a_dry_joint_fails_by_what_was_added(outcome, measured):
    """Five newton metres more at a drive of twenty are a quarter more of its duty cycle."""
    assert outcome.verdict("dry") is Verdict.FAILED
    (before,), (after,) = (measured(outcome, name, "stiction") for name in ("healthy", "dry"))
    assert after.value - before.value == pytest.approx(25.0, abs=2.0)


def test_what_does_not_move_is_not_driven_beyond_the_maximum(outcome):
    """In both directions."""
    assert outcome.verdict("jammed") is Verdict.FAILED
    assert "l_elbow does not move" in outcome.detail("jammed")
    for event in outcome.of(SeriesRecorded, test="s/jammed", subject="l_elbow"):
        if event.name.endswith("duty cycle"):
            with np.load(outcome.folder / event.path) as data:
                assert np.ptp(data["duty"]) == pytest.approx(10.0, abs=0.6)


def test_a_joint_that_meets_something_is_tested_elsewhere(outcome):
    """A mechanical stop is a degree away: the joint is tested at a place with more room, and passes."""
    assert outcome.verdict("in-the-way") is Verdict.PASSED, outcome.detail("in-the-way")
    assert "l_elbow does not move with a negative duty cycle at 16.0 deg: tried at 31.0 deg" in said(
        outcome, "in-the-way"
    )


def test_a_joint_at_the_edge_of_its_friction_correct_creep(outcome):
    """In all repetitions no ramp begins at a place to which the joint has crept."""
    assert outcome.verdict("right") is Verdict.PASSED, outcome.detail("right")
    ramps = [event for event in outcome.of(SeriesRecorded, test="s/right") if "duty cycle" in event.name]
    assert len(ramps) == 8  # so near to what is allowed each time counts
    for event in ramps:
        with np.load(outcome.folder / event.path) as data:
            assert abs(data["duty"][0]) > 0.1


def test_an_encoder_that_jitters_is_named(outcome):
    """Its joint is never at rest; the failure does not blame gravity, as the motor is at rest."""
    assert outcome.verdict("noisy") is Verdict.INCONCLUSIVE
    assert "the joint's encoder is noisy" in outcome.detail("noisy")


def test_a_motor_far_from_the_limit_is_tested_once(outcome):
    """Another measurement could not change the verdict."""
    assert len([*outcome.of(SeriesRecorded, test="s/healthy")]) == 2


def test_a_step_has_to_be_positive(outcome):
    """It is refused before anything moves."""
    assert outcome.exit_code != 0
    assert outcome.verdict("backwards") is Verdict.ERROR
    assert "outputStep" in outcome.detail("backwards")
