"""PositionDirect on the simulated robot."""

import re

import numpy as np
import pytest

from rtf.robot_testing.judging.sine import fit_sine
from rtf.testing.events import SeriesRecorded
from rtf.testing.verdict import Verdict

COMMON = """<parameter name="part">torso</parameter> <parameter name="joints">(0 2)</parameter>
<parameter name="cycles">1</parameter> <parameter name="frequency">1.0</parameter> PositionDirect </test>"""
SUITE = (
    "".join(
        f'<test name="{name}"><parameter name="inject">"{inject}"</parameter> {COMMON}'
        for name, inject in {
            "healthy": "",
            "lost": "missed_command torso_pitch every=3",
            "weak-gains": "wrong_gains torso_yaw factor=0.02",
            "jammed": "jam torso_yaw torque=2000",
        }.items()
    )
    + '<test name="one-form"><parameter name="cmdMode">2</parameter>'
    + COMMON
    + '<test name="half-a-swing"><parameter name="cmdMode">2</parameter>'
    + COMMON.replace('"cycles">1<', '"cycles">0.5<')
    + """<test name="too-fast"><parameter name="part">torso</parameter>
<parameter name="amplitude">20</parameter> <parameter name="frequency">5</parameter> PositionDirect </test>
<test name="no-joint"><parameter name="part">torso</parameter>
<parameter name="joints">(3)</parameter> PositionDirect </test>"""
)


@pytest.fixture(scope="module")
def outcome(run_on_robot):
    """One robot for all of them."""
    return run_on_robot(SUITE, parts="torso")


def test_a_healthy_part_passes_in_all_forms(outcome, measured):
    """Joint by joint, as a group and as a whole part, without lost commands."""
    assert outcome.verdict("healthy") is Verdict.PASSED
    lost = measured(outcome, "healthy", "commands lost")
    assert {one.subject for one in lost} == {
        f"{joint} {form}" for joint in ("torso_yaw", "torso_pitch") for form in ("single", "all", "group")
    }
    assert all(one.value == 0 for one in lost)


def test_the_references_at_the_board_are_a_sine(outcome, measured):
    """The references that the board itself reports have the amplitude and nothing but the shape of the sine."""
    sizes = measured(outcome, "healthy", "amplitude of the references at the board")
    shapes = measured(outcome, "healthy", "shape error of the references at the board")
    assert len(sizes) == len(shapes) == 6
    assert all(one.value == pytest.approx(1.0, abs=0.01) for one in sizes)
    assert all(one.value < 0.01 for one in shapes)


def test_the_joints_swing(outcome):
    """Each joint swings about its middle by the amplitude, and is at rest in the middle before and after."""
    recorded = [event for event in outcome.of(SeriesRecorded, name="following") if event.test.endswith("/healthy")]
    assert len(recorded) == 6
    for event in recorded:
        with np.load(outcome.folder / event.path) as data:
            time, position, reference = data["time"], data["position"], data["reference"]
        whole = (time > 1.0) & (time < 2.0)
        assert fit_sine(time[whole], reference[whole], 1.0).amplitude == pytest.approx(3.0, abs=0.05)
        assert fit_sine(time[whole], position[whole], 1.0).amplitude == pytest.approx(3.0, abs=0.6)
        assert position[0] == pytest.approx(reference[0], abs=0.2)
        assert abs(reference[-1] - reference[0]) < 0.05


@pytest.mark.parametrize(
    ("name", "joint", "what"),
    [
        ("lost", "torso_pitch", "commands lost"),
        ("weak-gains", "torso_yaw", "tracking error"),
    ],
)
def test_each_fault_is_found_at_its_joint_only(outcome, measured, name, joint, what):
    """The joint that is broken fails in every form, and the other one passes."""
    assert outcome.verdict(name) is Verdict.FAILED
    broken = measured(outcome, name, what, joint)
    assert broken  # a form may end early, when the guard gives the joint up
    assert all(one.margin < 0 for one in broken)
    other = {"torso_yaw": "torso_pitch", "torso_pitch": "torso_yaw"}[joint]
    assert all(one.margin >= 0 for one in measured(outcome, name, what, other))


def test_a_blocked_joint_is_released(outcome, measured):
    """It fails before a swing is complete, and the other one passes."""
    assert outcome.verdict("jammed") is Verdict.FAILED
    assert re.search(r"torso_yaw \(/icubSim/torso joint 0\) .*; it was released", outcome.detail("jammed"))
    assert all(one.margin >= 0 for one in measured(outcome, "jammed", "amplitude", "torso_pitch"))


def test_a_form_may_be_chosen_as_in_older_files(outcome, measured):
    """``cmdMode 2`` is the group of the joints."""
    assert outcome.verdict("one-form") is Verdict.PASSED
    assert {one.subject for one in measured(outcome, "one-form", "delay")} == {"torso_yaw group", "torso_pitch group"}


def test_less_than_a_swing_may_be_asked_for(outcome):
    """As in older files. A whole swing is done, which can be judged as a sine."""
    assert outcome.verdict("half-a-swing") is Verdict.PASSED
    event, *_ = (one for one in outcome.of(SeriesRecorded, name="following") if one.test.endswith("/half-a-swing"))
    with np.load(outcome.folder / event.path) as data:
        assert data["time"][-1] == pytest.approx(3.0, abs=0.1)


def test_what_cannot_be_is_an_error(outcome):
    """A sine that is too fast for the joints, and a missing joint, end the test before any motion."""
    assert outcome.verdict("too-fast") is Verdict.ERROR
    assert "deg" in outcome.detail("too-fast")
    assert outcome.verdict("no-joint") is Verdict.ERROR
    assert "torso_roll" in outcome.detail("no-joint")
