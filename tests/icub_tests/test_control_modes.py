"""ControlModes on the simulated robot."""

import numpy as np
import pytest

from robot_outcomes import said
from rtf.robot.control_modes import STATES, TRANSITIONS, USER_MODES, ControlMode
from rtf.robot_testing.motion.modes import ModeWalk
from rtf.testing.events import Message, SeriesRecorded, Severity
from rtf.testing.verdict import Verdict

TORSO = '<parameter name="part">torso</parameter>'
SUITE = f"""
<test name="healthy"> {TORSO} ControlModes </test>
<test name="afterwards"> {TORSO} JointLimits </test>
<test name="torque-is-position"> {TORSO} <parameter name="inject">"wrong_mode torso_roll"</parameter>
  <parameter name="faults">false</parameter> <parameter name="without">(vel mix posd ipwm icur)</parameter>
  ControlModes </test>
<test name="shown-late"> {TORSO} <parameter name="inject">"mode_stale torso_roll age=0.6"</parameter>
  <parameter name="faults">false</parameter> <parameter name="without">(vel torq mix posd icur)</parameter>
  ControlModes </test>
<test name="leaves-faults"> {TORSO} <parameter name="inject">"fault_left torso_pitch"</parameter>
  <parameter name="without">(vel torq mix posd ipwm icur)</parameter> ControlModes </test>
<test name="stopped"> <parameter name="part">head</parameter> <parameter name="faults">false</parameter>
  <parameter name="inject">"torque_bias neck_yaw bias=100 delay=1"</parameter>
  <parameter name="without">(mix posd ipwm icur)</parameter> ControlModes </test>
<test name="no-such-mode"> {TORSO} <parameter name="without">(fly)</parameter> ControlModes </test>
"""


@pytest.fixture(scope="module")
def outcome(run_on_robot):
    """The suite above, run once."""
    return run_on_robot(SUITE, parts="head,torso")


def failures_of(outcome, test):
    """The joints in whose sub-results something failed."""
    return {message.subject for message in outcome.of(Message, severity=Severity.FAILURE, test=f"s/{test}")}


def test_a_healthy_part_answers_every_request_in_every_mode(outcome, measured):
    """Each joint is given each pair of mode and request of the table that can be brought about."""
    assert outcome.verdict("healthy") is Verdict.PASSED
    states = (*USER_MODES, ControlMode.IDLE, ControlMode.HARDWARE_FAULT)
    pairs = [pair for pair in TRANSITIONS if pair[0] in states]
    tried = measured(outcome, "healthy", "requests tried")
    assert [event.value for event in tried] == [len(pairs)] * 3
    assert all(event.value == 0 for event in measured(outcome, "healthy", "wrong answers"))


def test_what_was_asked_for_is_recorded_beside_what_was_read(outcome):
    """As the numbers of the legend. On a healthy robot they differ only while a mode changes."""
    series = outcome.of(SeriesRecorded, name="modes", test="s/healthy")
    assert [one.subject for one in series] == ["torso_yaw", "torso_roll", "torso_pitch"]
    with np.load(outcome.folder / series[0].path) as data:
        assert set(data["mode"]) == set(data["expected"])
        assert len(set(data["mode"])) == len(USER_MODES) + 2
        assert np.mean(data["mode"] == data["expected"]) > 0.8
    assert "modes by number: 0 pos" in said(outcome, "healthy")


def test_modes_that_are_shown_late_are_late_not_wrong(outcome, measured):
    """The delay is measured, and the other joints have none."""
    assert outcome.verdict("shown-late") is Verdict.FAILED
    assert failures_of(outcome, "shown-late") == {"torso_roll"}
    assert "torso_roll shows a new mode after 0.6" in outcome.detail("shown-late")
    late = {one.subject: one.value for one in measured(outcome, "shown-late", "slowest change")}
    assert 550.0 < late["torso_roll"] < 700.0
    assert late["torso_yaw"] < 100.0
    assert all(one.value == 0 for one in measured(outcome, "shown-late", "wrong answers"))


def test_the_part_is_fit_for_work_afterwards(outcome):
    """Maximum currents and modes are restored."""
    assert outcome.verdict("afterwards") is Verdict.PASSED


@pytest.mark.parametrize(
    ("test", "joint", "words"),
    [
        ("torque-is-position", "torso_roll", "after a request for torq in pos it is in pos, not torq"),
        ("leaves-faults", "torso_pitch", "after a request for pos in hwfa it is in pos, not hwfa"),
    ],
)
def test_a_wrong_answer_fails_at_its_joint_only(outcome, test, joint, words):
    """The failure says what was asked for, in which mode, and what was read."""
    assert outcome.verdict(test) is Verdict.FAILED
    assert failures_of(outcome, test) == {joint}
    (message,) = outcome.of(Message, severity=Severity.FAILURE, test=f"s/{test}")
    assert words in message.detail
    assert "likely: firmware" in message.detail


def test_a_joint_that_has_to_be_stopped_ends_nothing_but_its_own_part(outcome, measured):
    """The failure names it, and the other joints go through all their modes without it."""
    assert outcome.verdict("stopped") is Verdict.FAILED
    assert failures_of(outcome, "stopped") == {"neck_yaw"}
    tried = measured(outcome, "stopped", "requests tried")
    assert len(tried) == 5
    assert "neck_yaw" not in {event.subject for event in tried}


def test_a_mode_that_does_not_exist_is_an_error(outcome):
    """The error lists the valid words."""
    assert outcome.verdict("no-such-mode") is Verdict.ERROR
    assert "icur" in outcome.detail("no-such-mode")


@pytest.mark.parametrize("without", [[], [ControlMode.CURRENT], [ControlMode.TORQUE, ControlMode.MIXED]])
def test_a_walk_makes_every_request_in_every_mode(without):
    """From any first mode, with few requests made twice, and without the modes that the robot lacks."""
    states = [state for state in STATES if state in (*USER_MODES, ControlMode.IDLE)]
    walk = ModeWalk(states, without)
    needed, made, state = walk.pairs, [], ControlMode.POSITION
    while (request := walk.next_request(state)) is not None:
        made.append((state, request))
        state = TRANSITIONS[state, request]
    assert set(made) == needed
    assert len(made) < 1.2 * len(needed)
    assert not {mode for pair in made for mode in pair} & set(without)
