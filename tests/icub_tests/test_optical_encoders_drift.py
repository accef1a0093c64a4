"""OpticalEncodersDrift on the simulated robot."""

import numpy as np
import pytest

from robot_outcomes import failed_parts, said
from rtf.testing.events import SeriesRecorded, SubResultEnded
from rtf.testing.verdict import Verdict

TORSO = '<parameter name="part">torso</parameter> <parameter name="every">3</parameter>'


def entry(name, inject="", more=""):
    """A test of the suite."""
    inject = f'<parameter name="inject">"{inject}"</parameter>'
    return f'<test name="{name}"> {TORSO} {inject} {more} OpticalEncodersDrift </test>'


SUITE = "".join([
    entry("healthy", more='<parameter name="cycles">24</parameter>'),
    entry("lost-ticks", "motor_encoder_drift torso_yaw rate=3", '<parameter name="cycles">24</parameter>'),
    entry("jump", "motor_encoder_jump torso_roll delay=12", '<parameter name="cycles">36</parameter>'),
    entry("joint", "encoder_drift torso_yaw", '<parameter name="cycles">36</parameter>'),
    entry("frozen", "motor_encoder_frozen torso_pitch", '<parameter name="cycles">6</parameter>'),
    entry("play", "backlash torso_yaw play=0.3", '<parameter name="cycles">12</parameter>'),
    entry("pitch", "encoder_frozen torso_pitch", '<parameter name="cycles">6</parameter>'),
    entry("none", more='<parameter name="cycles">0</parameter>'),
])  # fmt: skip


@pytest.fixture(scope="module")
def outcome(run_on_robot):
    """The suite above, run once."""
    return run_on_robot(SUITE, parts="torso")


def visits(outcome, test):
    """The values that were recorded at home, by column."""
    (event,) = outcome.of(SeriesRecorded, name="drift at home", test=f"s/{test}")
    with np.load(outcome.folder / event.path) as data:
        return {key: data[key] for key in data}


def test_healthy_encoders_come_back(outcome, measured):
    """At every visit of home, to a few hundredths of a degree; coupled motors, too."""
    assert outcome.verdict("healthy") is Verdict.PASSED, outcome.detail("healthy")
    rows = visits(outcome, "healthy")
    assert [*rows["half_swings"]] == [3.0 * number for number in range(1, 9)]
    for joint in ("torso_yaw", "torso_roll", "torso_pitch"):
        assert np.abs(rows[joint]).max() < 0.03
        (turned,) = measured(outcome, "healthy", "turn of the motor by the joint's", joint)
        assert turned.value == pytest.approx(1.0, abs=0.02)


def test_lost_ticks_are_a_trend(outcome, measured):
    """Three degrees of the rotor a second are 0.03 of the joint; the trend is far beyond its interval."""
    assert outcome.verdict("lost-ticks") is Verdict.FAILED
    assert failed_parts(outcome, "lost-ticks") == ["torso_yaw"]
    (trend,) = measured(outcome, "lost-ticks", "trend in 100 half-swings", "torso_yaw")
    (interval,) = measured(outcome, "lost-ticks", "interval of the trend (99 %)", "torso_yaw")
    assert abs(trend.value) > 5 * interval.value
    assert "gradually" in said(outcome, "lost-ticks")


def test_a_jump_is_told_from_a_trend(outcome, measured):
    """It has a time, and ends the test once it is certain."""
    assert outcome.verdict("jump") is Verdict.FAILED
    (last,) = measured(outcome, "jump", "drift at the end", "torso_roll")
    assert abs(last.value) == pytest.approx(7.2, abs=0.1)  # a turn of a rotor at 100 : 1, geared by half
    assert "in one jump" in said(outcome, "jump")
    assert len(visits(outcome, "jump")["half_swings"]) < 12


def test_a_joint_encoder_that_runs_away_ends_it_early(outcome):
    """As the joint follows its encoder."""
    assert outcome.verdict("joint") is Verdict.FAILED
    assert failed_parts(outcome, "joint") == ["torso_yaw"]
    assert len(visits(outcome, "joint")["half_swings"]) < 4


def test_a_frozen_motor_encoder_does_not_pass_for_one_without_drift(outcome):
    """Its value does not change between the visits of home either."""
    assert outcome.verdict("frozen") is Verdict.FAILED
    assert "torso_pitch swings, but its motor encoder does not" in said(outcome, "frozen")


def test_play_is_no_drift(outcome):
    """Home is reached from the same side each time."""
    assert outcome.verdict("play") is Verdict.PASSED, outcome.detail("play")
    assert np.ptp(visits(outcome, "play")["torso_yaw"]) < 0.1


def test_of_a_joint_that_is_coupled_with_a_lost_one_nothing_is_said(outcome):
    """The joint with the frozen encoder fails; the coupled one, which is idle with it, has no verdict."""
    assert outcome.verdict("pitch") is Verdict.FAILED
    assert failed_parts(outcome, "pitch") == ["torso_pitch"]
    (other,) = outcome.of(SubResultEnded, verdict=Verdict.INCONCLUSIVE, subject="torso_roll")
    assert other.test == "s/pitch"
    assert "torso_roll is coupled with torso_pitch, which was left without power" in said(outcome, "pitch")


def test_no_swings_are_no_test(outcome):
    """A test without swings is refused."""
    assert outcome.verdict("none") is Verdict.ERROR
    assert "cycles" in outcome.detail("none")
