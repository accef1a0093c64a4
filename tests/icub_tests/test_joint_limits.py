"""JointLimits on the simulated robot."""

import numpy as np
import pytest

from icub import ICUB, PARTS
from robot_outcomes import failed_parts
from rtf.robot_testing.motion.joint_queues import queues
from rtf.testing.events import SeriesRecorded
from rtf.testing.verdict import Verdict

HEAD = '<parameter name="part">head</parameter>'
SUITE = f"""
<test name="healthy"> {HEAD} JointLimits </test>
<test name="wrong-limit"> {HEAD} <parameter name="inject">"wrong_upper_limit neck_yaw by=20"</parameter>
  <parameter name="joints">(0 2)</parameter> JointLimits </test>
<test name="pushes-on"> {HEAD} <parameter name="inject">"limits_ignored eyes_tilt"</parameter>
  <parameter name="joints">(3 4)</parameter> JointLimits </test>
<test name="too-low"> {HEAD} <parameter name="joints">(1)</parameter> <parameter name="upper">(25)</parameter>
  JointLimits </test>
<test name="too-narrow"> {HEAD} <parameter name="joints">(2)</parameter> <parameter name="modelled">true</parameter>
  <parameter name="inject">"wrong_upper_limit neck_yaw by=-1"</parameter> JointLimits </test>
<test name="runs-away"> {HEAD} <parameter name="inject">"motor_sign neck_yaw delay=3"</parameter>
  <parameter name="joints">(1 2 3)</parameter> JointLimits </test>
<test name="beside"> {HEAD} <parameter name="inject">"torque_bias neck_yaw bias=100 delay=1"</parameter>
  <parameter name="joints">(1 3)</parameter> JointLimits </test>
<test name="dead"> {HEAD} <parameter name="inject">"motor_dead neck_yaw"</parameter>
  <parameter name="home">(5)</parameter> JointLimits </test>
<test name="no-range"> {HEAD} <parameter name="inject">"wrong_upper_limit neck_yaw by=-150"</parameter>
  <parameter name="joints">(1 2)</parameter> JointLimits </test>
<test name="no-such-joint"> {HEAD} <parameter name="joints">(9)</parameter> JointLimits </test>
<test name="one-value-too-few"> {HEAD} <parameter name="speed">(10 20)</parameter> JointLimits </test>
"""


@pytest.fixture(scope="module")
def outcome(run_on_robot):
    """The suite above, run once."""
    return run_on_robot(SUITE, parts="head")


def test_a_healthy_part_reaches_all_its_limits(outcome, measured):
    """Each joint is measured at both limits, and its recorded positions reach them."""
    assert outcome.verdict("healthy") is Verdict.PASSED
    for axis in PARTS["head"]:
        for side in ("upper", "lower"):
            assert len(measured(outcome, "healthy", f"short of the {side} limit", axis.name)) == 1
            assert len(measured(outcome, "healthy", f"push beyond the {side} limit", axis.name)) == 1
        (series,) = outcome.of(SeriesRecorded, name=f"{axis.name}: position", test="s/healthy")
        with np.load(outcome.folder / series.path) as data:
            positions, target, low, high = (data[key] for key in ("position", "target", "lower_limit", "upper_limit"))
        assert positions.max() == pytest.approx(axis.maximum, abs=0.5)
        assert positions.min() == pytest.approx(axis.minimum, abs=0.5)
        assert (target.max(), target.min()) == pytest.approx((axis.maximum + 2.0, axis.minimum - 2.0))
        assert {*low, *high} == {axis.minimum, axis.maximum}


def test_a_limit_that_is_too_narrow_fails_though_it_is_reached(outcome, measured):
    """It is a degree less than in the robot's model."""
    assert outcome.verdict("too-narrow") is Verdict.FAILED
    (limit,) = measured(outcome, "too-narrow", "upper limit", "neck_yaw")
    assert (limit.value, limit.low, limit.high) == pytest.approx((49.0, 49.5, 50.5))


def test_a_limit_that_cannot_be_reached_fails_at_its_joint_only(outcome, measured):
    """The other joint of the same run passes."""
    assert outcome.verdict("wrong-limit") is Verdict.FAILED
    (far,) = measured(outcome, "wrong-limit", "short of the upper limit", "neck_yaw")
    assert far.value == pytest.approx(20.0, abs=1.0)
    (near,) = measured(outcome, "wrong-limit", "short of the upper limit", "neck_pitch")
    assert near.value < 0.5
    said = outcome.detail("wrong-limit")
    assert "neck_yaw stops at" in said
    assert "likely: a limit in the configuration beyond the hardware's" in said


def test_a_board_that_does_not_keep_its_limits_pushes_against_the_stop(outcome, measured):
    """The joint is at its mechanical stop, so that only the output of its controller shows the fault."""
    assert outcome.verdict("pushes-on") is Verdict.FAILED
    (tilt,) = measured(outcome, "pushes-on", "push beyond the upper limit", "eyes_tilt")
    assert tilt.value > tilt.high
    (version,) = measured(outcome, "pushes-on", "push beyond the upper limit", "eyes_version")
    assert version.value < 1.0


def test_limits_that_can_be_reached_are_compared_with_those_that_are_expected(outcome):
    """A limit of 20 degrees fails where 25 are expected."""
    assert outcome.verdict("too-low") is Verdict.FAILED
    assert "not 25 deg; likely: a limit of another joint" in outcome.detail("too-low")


def test_a_joint_that_runs_away_is_stopped_and_fails_alone(outcome, measured):
    """The stop by the guard is a failure of this joint; the joints before and after it are judged."""
    assert outcome.verdict("runs-away") is Verdict.FAILED
    assert failed_parts(outcome, "runs-away") == ["neck_yaw"]
    assert "it was stopped" in outcome.detail("runs-away")
    for joint in ("neck_roll", "eyes_tilt"):
        assert len(measured(outcome, "runs-away", "short of the lower limit", joint)) == 1


def test_a_joint_that_is_stopped_beside_another_is_blamed_itself(outcome, measured):
    """The joint whose turn it was has no verdict; the next one is judged."""
    assert outcome.verdict("beside") is Verdict.FAILED
    assert failed_parts(outcome, "beside") == ["neck_yaw"]
    assert measured(outcome, "beside", "short of the lower limit", "neck_roll") == []
    assert len(measured(outcome, "beside", "short of the lower limit", "eyes_tilt")) == 1


def test_a_joint_that_does_not_come_home_hides_no_other(outcome, measured):
    """The failure names it; all others are measured at both limits."""
    assert outcome.verdict("dead") is Verdict.FAILED
    assert failed_parts(outcome, "dead") == ["neck_yaw"]
    assert "neck_yaw (/icubSim/head joint 2) does not move" in outcome.detail("dead")
    assert "a broken motor cable" in outcome.detail("dead")
    tested = {event.subject for event in measured(outcome, "dead", "short of the lower limit")}
    assert tested == {axis.name for axis in PARTS["head"]} - {"neck_yaw"}


def test_limits_without_a_range_are_a_failure_of_their_joint(outcome, measured):
    """A wrong configuration is what the test is to find."""
    assert outcome.verdict("no-range") is Verdict.FAILED
    assert failed_parts(outcome, "no-range") == ["neck_yaw"]
    assert "swapped or missing limits in the configuration" in outcome.detail("no-range")
    assert len(measured(outcome, "no-range", "short of the lower limit", "neck_roll")) == 1


def test_wrong_parameters_are_errors_that_say_what_there_is(outcome):
    """No joint moves, and the error lists the valid values."""
    assert outcome.verdict("no-such-joint") is Verdict.ERROR
    assert "neck_pitch" in outcome.detail("no-such-joint")
    assert outcome.verdict("one-value-too-few") is Verdict.ERROR
    assert "speed has 2 values" in outcome.detail("one-value-too-few")


@pytest.mark.parametrize("part", PARTS)
def test_every_joint_has_one_place_in_the_queues(part):
    """None is forgotten, none is moved twice."""
    names = [axis.name for axis in PARTS[part]]
    found = queues(names, range(len(names)), ICUB.together(part))
    members = [joint for queue in found for group in queue for joint in group]
    assert sorted(members) == list(range(len(names)))


def test_large_joints_move_one_at_a_time():
    """Shoulder and elbow never share a round, nor are they in different queues."""
    names = [axis.name for axis in PARTS["left_arm"]]
    first, fingers = queues(names, range(len(names)), ICUB.together("left_arm"))
    assert first == [[0], [1], [2], [3], [4, 5, 6]]
    assert fingers == [[8, 9, 10], [7, 11, 12, 13, 14, 15]]
    assert queues(["a", "b"], [1, 0]) == [[[1], [0]]]
