"""OpticalEncodersConsistency on the simulated robot."""

import numpy as np
import pytest

from robot_outcomes import failed_parts, said
from rtf.testing.events import SeriesRecorded
from rtf.testing.verdict import Verdict

TORSO = '<parameter name="part">torso</parameter>'
ARM = '<parameter name="part">left_arm</parameter> <parameter name="joints">(0 1 2)</parameter>'
WRIST = '<parameter name="part">left_arm</parameter> <parameter name="joints">(4 5 6)</parameter>'


def entry(name, inject="", where=TORSO, more="", test="OpticalEncodersConsistency"):
    """A test of the suite."""
    inject = f'<parameter name="inject">"{inject}"</parameter>'
    return f'<test name="{name}"> {where} {inject} {more} {test} </test>'


SUITE = "".join([
    entry("healthy", more='<parameter name="matrix">(1 0 0  0 0.5 -0.5  0 0.5 0.5)</parameter>'),
    entry("other-name", where=ARM, test="MotorEncodersConsistency"),
    entry("ratio", "wrong_gear_ratio torso_yaw factor=1.5"),
    entry("coupling", "wrong_coupling l_shoulder_roll", ARM),
    entry("play", "backlash l_wrist_prosup play=2", WRIST),
    entry("hunting", "backlash l_shoulder_yaw", ARM),
    entry("frozen", "encoder_frozen torso_yaw"),
    entry("short-list", more='<parameter name="speed">(20 20)</parameter>'),
])  # fmt: skip


@pytest.fixture(scope="module")
def outcome(run_on_robot):
    """The suite above, run once."""
    return run_on_robot(SUITE, parts="left_arm,torso")


def test_a_healthy_torso_agrees_with_its_coupled_motors(outcome, measured):
    """Each ratio is 1 to the fourth figure, whatever the signs of gears and couplings."""
    assert outcome.verdict("healthy") is Verdict.PASSED, outcome.detail("healthy")
    ratios = measured(outcome, "healthy", "ratio to what is configured")
    assert [ratio.value for ratio in ratios] == pytest.approx([1.0] * 3, abs=1e-3)
    assert outcome.verdict("other-name") is Verdict.PASSED, outcome.detail("other-name")


def test_the_joints_have_swung(outcome):
    """The recorded positions go to both sides by the amplitude, twice."""
    for event in outcome.of(SeriesRecorded, name="joint and motor", test="s/healthy"):
        with np.load(outcome.folder / event.path) as data:
            joint = data["joint"]
        assert np.ptp(joint) >= 18.0 * (0.5 if "torso_yaw" not in event.subject else 1.0)
        crossings = np.flatnonzero(np.diff(np.sign(joint - (joint.max() + joint.min()) / 2)))
        assert len(crossings) >= 3


def test_a_ratio_is_measured_and_a_known_stage_recognized(outcome, measured):
    """A gearbox of 150 where 100 are configured."""
    assert outcome.verdict("ratio") is Verdict.FAILED
    (found,) = measured(outcome, "ratio", "ratio to what is configured", "torso_yaw")
    assert found.value == pytest.approx(1 / 1.5, abs=1e-3)
    assert "a stage of 1.5" in said(outcome, "ratio")


def test_a_wrong_row_of_the_couplings_is_found_at_its_motor_only(outcome, measured):
    """The error by the other joint that turns this motor is measured."""
    assert failed_parts(outcome, "coupling") == ["l_shoulder_roll"]
    ratios = [one.value for one in measured(outcome, "coupling", "ratio to what is configured")]
    assert ratios == pytest.approx([1.0, 2.0, 1.0], abs=5e-3)
    (error,) = measured(outcome, "coupling", "greatest error of a coupling", "l_shoulder_roll")
    assert error.value == pytest.approx(-1.0, abs=1e-3)
    assert "l_shoulder_pitch" in said(outcome, "coupling")


def test_play_is_measured_and_not_taken_for_a_ratio(outcome, measured):
    """Two degrees from side to side, nearly all of which is seen."""
    assert failed_parts(outcome, "play") == ["l_wrist_prosup"]
    (play,) = measured(outcome, "play", "play", "l_wrist_prosup")
    assert play.value == pytest.approx(2.0, abs=0.3)
    (ratio,) = measured(outcome, "play", "ratio to what is configured", "l_wrist_prosup")
    assert ratio.low <= ratio.value <= ratio.high


def test_a_joint_that_hunts_in_its_play_is_named(outcome):
    """The controller drives the joint from side to side of a large play; that is not the fault of another one."""
    assert failed_parts(outcome, "hunting") == ["l_shoulder_yaw"]
    assert "play in the gearbox" in said(outcome, "hunting")


def test_a_joint_that_is_turned_unseen_is_stopped_at_once(outcome):
    """With a frozen encoder the controller would turn the joint further; it gets no power."""
    assert outcome.verdict("frozen") is Verdict.FAILED
    assert "torso_yaw does not move by its encoder," in said(outcome, "frozen")
    assert "torso_yaw is left idle" in said(outcome, "frozen")


def test_a_list_that_is_too_short_is_an_error(outcome):
    """Joints without a speed are not moved."""
    assert outcome.verdict("short-list") is Verdict.ERROR
    assert "speed has 2 values" in outcome.detail("short-list")
