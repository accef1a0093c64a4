"""MotorTest, MovementReferencesTest, OpenLoopConsistency and position-stress on one simulated robot."""

import numpy as np
import pytest

from icub import PARTS
from rtf.testing.events import Message, SeriesRecorded, Severity
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.verdict import Verdict

NAMES = [axis.name for axis in PARTS["torso"]]


def entry(name, test, inject="", **parameters):
    """A test of the torso, as a suite has it."""
    if inject:
        parameters["inject"] = f'"{inject}"'
    if "portname" not in parameters:
        parameters["part"] = "torso"
    rows = "".join(f'<parameter name="{key}">{value}</parameter>' for key, value in parameters.items())
    return f'<test name="{name}">{rows} {test} </test>'


SUITE = "".join(
    [
        entry(
            "motors", "MotorTest", portname="/icubSim/torso", joints=3, target="3.0 3.0 3.0", min="0.5 0.5 0.5",
            max="0.5 0.5 0.5", refvel="20.0 20.0 20.0", timeout="10.0 10.0 10.0",
        ),
        entry("motor-jams", "MotorTest", "jam torso_yaw"),
        entry("motor-without-command", "MotorTest", "missed_command torso_roll every=1"),
        entry("other-axes", "MotorTest", joints=4),
        entry("one-target-too-few", "MotorTest", target="3.0 3.0"),
        entry("references", "MovementReferencesTest"),
        entry("references-slow", "MovementReferencesTest", refAcc="0.1"),
        entry("references-lost", "MovementReferencesTest", "missed_command torso_pitch every=1", joints="(0 2)"),
        entry("references-no-mode", "MovementReferencesTest", "mode_ignored torso_yaw"),
        entry("open-loop", "OpenLoopConsistency"),
        entry("open-loop-pitch", "OpenLoopConsistency", joints="(2)"),
        entry("open-loop-lost", "OpenLoopConsistency", "missed_command torso_roll every=1"),
        entry("open-loop-no-mode", "OpenLoopConsistency", "mode_ignored torso_yaw"),
        entry("open-loop-beyond-limits", "OpenLoopConsistency", "encoder_bias torso_roll bias=60 delay=0.2"),
        entry("stress", "position-stress"),
        entry("stress-jams", "position-stress", "jam torso_pitch", cycles=1),
        entry("stress-dead", "position-stress", "motor_dead torso_yaw", home="(3)", cycles=1),
        entry("references-dead", "MovementReferencesTest", "motor_dead torso_yaw", home="(3)"),
        entry("open-loop-dead", "OpenLoopConsistency", "motor_dead torso_yaw", home="(3)"),
        entry("stress-never", "position-stress", shortest=2, longest=1),
    ]
)  # fmt: skip


@pytest.fixture(scope="module")
def outcome(run_on_robot):
    """The suite above, run once."""
    return run_on_robot(SUITE, parts="torso")


def failed_in(outcome, test):
    """The joints in whose sub-results something failed."""
    messages = outcome.of(Message, severity=Severity.FAILURE, test=f"s/{test}")
    return {message.subject.split(" ")[0] for message in messages}


def positions_of(outcome, test, name, subject="", column="position"):
    """What was recorded (deg)."""
    (series,) = [one for one in outcome.of(SeriesRecorded, name=name, test=f"s/{test}") if one.subject == subject]
    return np.load(outcome.folder / series.path)[column]


@pytest.mark.parametrize("test", ["motors", "references", "references-slow", "open-loop", "stress"])
def test_a_healthy_robot_passes(outcome, test):
    """MotorTest with the parameters of an old file, the others with the part as their only parameter."""
    assert outcome.verdict(test) is Verdict.PASSED, outcome.detail(test)


@pytest.mark.parametrize(
    ("test", "joint"),
    [
        ("motor-jams", "torso_yaw"),
        ("motor-without-command", "torso_roll"),
        ("references-lost", "torso_pitch"),
        ("references-no-mode", "torso_yaw"),
        ("open-loop-lost", "torso_roll"),
        ("open-loop-no-mode", "torso_yaw"),
        ("stress-jams", "torso_pitch"),
    ],
)
def test_a_fault_fails_at_its_joint(outcome, test, joint):
    """The others of the part are tested all the same, and pass."""
    assert outcome.verdict(test) is Verdict.FAILED
    assert failed_in(outcome, test) - {"torso"} == {joint}


@pytest.mark.parametrize(
    ("test", "measurement"),
    [
        ("stress-dead", "range"),
        ("references-dead", "reference velocity"),
        ("open-loop-dead", "reference kept after leaving"),
    ],
)
def test_a_joint_that_does_not_come_home_hides_no_other(outcome, measured, test, measurement):
    """The failure names it, with causes; the others are tested."""
    assert outcome.verdict(test) is Verdict.FAILED
    assert failed_in(outcome, test) == {"torso_yaw"}
    assert "a broken motor cable" in outcome.detail(test)
    assert {one.subject for one in measured(outcome, test, measurement)} == {"torso_roll", "torso_pitch"}


def test_joints_that_are_not_in_the_mode_have_causes(outcome):
    """The message has likely causes."""
    texts = [message.detail for message in outcome.of(Message, severity=Severity.FAILURE, test="s/open-loop-no-mode")]
    wrong = [text for text in texts if "not in PWM mode" in text]
    assert wrong
    assert all("likely: firmware" in text for text in wrong)


def test_commands_are_recorded_beside_positions(outcome):
    """Targets of moves, and positions that follow from a commanded speed."""
    assert set(positions_of(outcome, "motors", "single move", "torso_yaw single", "target")) == {3.0}
    targets = positions_of(outcome, "stress", "stress", "torso_yaw", "target")
    assert np.unique(targets).tolist() == pytest.approx([-10.0, 0.0, 10.0], abs=0.01)
    way, commanded = (
        positions_of(outcome, "references", "velocity of torso_yaw", "", one) for one in ("position", "commanded")
    )
    assert way[0] == commanded[0]
    assert 1.0 < abs(commanded[-1] - commanded[0]) < 3.0
    assert way == pytest.approx(commanded, abs=0.5)


def test_each_motor_moves_alone_then_all_then_as_a_group(outcome, measured):
    """Each joint moves to its target and back in each form."""
    for name in NAMES:
        for kind, begin, end in (("single", 0.0, 3.0), ("all", 3.0, 0.0), ("group", 0.0, 3.0)):
            positions = positions_of(outcome, "motors", f"{kind} move", f"{name} {kind}")
            assert positions[0] == pytest.approx(begin, abs=0.3)
            assert positions[-1] == pytest.approx(end, abs=0.3)
            (rise,) = measured(outcome, "motors", "rise", f"{name} {kind}")
            assert 0.01 < rise.value < 1.0


def test_another_number_of_axes_is_a_failure_and_a_missing_target_an_error(outcome):
    """The number of axes belongs to the robot, the targets are parameters."""
    assert outcome.verdict("other-axes") is Verdict.FAILED
    assert "3 axes, not 4" in outcome.detail("other-axes")
    assert outcome.verdict("one-target-too-few") is Verdict.ERROR
    assert "target has 2 values" in outcome.detail("one-target-too-few")


def test_every_reference_is_commanded_and_read_back(outcome, measured):
    """Each commanded value differs from the one before, so that a test that sends nothing fails."""
    commanded = {"target position": 5.0, "reference duty cycle": 2.0, "reference velocity": 5.0, "speed": 5.0}
    for what, size in commanded.items():
        events = measured(outcome, "references", what)
        assert len(events) == len(NAMES)
        assert all(abs(event.value) == pytest.approx(size, rel=0.4) for event in events)
    assert len(measured(outcome, "references", "target position after a move in PWM mode")) == len(NAMES)


def test_the_open_loop_is_driven_both_ways(outcome, measured):
    """The motors get one per cent, nothing, and one per cent the other way."""
    for when, duty in (("on entering", 0), ("at 1 %", 1), ("at 0 %", 0), ("at -1 %", -1)):
        events = measured(outcome, "open-loop", f"output {when}")
        assert [event.value for event in events] == pytest.approx([duty] * len(NAMES), abs=0.05)


def test_joints_that_share_motors_are_driven_together(outcome, measured):
    """Else the controller of one would drive the motor of the other, which would look like a lost command."""
    assert outcome.verdict("open-loop-pitch") is Verdict.PASSED
    events = measured(outcome, "open-loop-pitch", "output at 1 %")
    assert {event.subject for event in events} == {"torso_roll", "torso_pitch"}


def test_a_joint_that_has_to_be_stopped_is_left_out(outcome, measured):
    """It fails; joints that share its motors get no verdict, and the others are driven to the end."""
    assert outcome.verdict("open-loop-beyond-limits") is Verdict.FAILED
    assert failed_in(outcome, "open-loop-beyond-limits") == {"torso_roll"}
    assert "beyond its limits; it was stopped" in outcome.detail("open-loop-beyond-limits")
    (kept,) = measured(outcome, "open-loop-beyond-limits", "reference kept after leaving")
    assert kept.subject == "torso_yaw"


def test_stress_moves_each_joint_to_and_fro(outcome, measured):
    """Each joint moves to both sides of home within its limits, and returns."""
    for name in NAMES:
        positions = positions_of(outcome, "stress", "stress", name)
        assert positions.max() > 4.0
        assert positions.min() < -4.0
        (away,) = measured(outcome, "stress", "away from where it began", name)
        assert away.verdict is MeasurementVerdict.PASSED


def test_waits_that_cannot_be_are_an_error(outcome):
    """The shortest wait must not be longer than the longest."""
    assert outcome.verdict("stress-never") is Verdict.ERROR
    assert "shortest" in outcome.detail("stress-never")
