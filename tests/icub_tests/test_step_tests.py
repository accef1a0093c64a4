"""The three tests of step responses on the simulated robot: position, position with a controller of its own, torque."""

import numpy as np
import pytest

from rtf.testing.events import Message, SeriesRecorded, SubResultEnded
from rtf.testing.verdict import Severity, Verdict


def entry(name, test, inject="", **parameters):
    """A test of the suite."""
    rows = "".join(f'<parameter name="{key}">{value}</parameter>' for key, value in parameters.items())
    return f'<test name="{name}"><parameter name="inject">"{inject}"</parameter>{rows} {test} </test>'


NECK = {"part": "head", "joints": "(2)", "cycles": 2}
TORSO = {"part": "torso", "joints": "(0)", "cycles": 2}
ROLL_PITCH = {"part": "torso", "joints": "(1 2)", "cycles": 2}
SUITE = "".join([
    entry("position", "PositionControlAccuracy", **TORSO, home_tolerance=0.3),
    entry("position-gains", "PositionControlAccuracy", "wrong_gains torso_yaw", **TORSO),
    entry("position-jam", "PositionControlAccuracy", "jam torso_yaw torque=2000", **TORSO),
    entry("position-weak", "PositionControlAccuracy", "motor_weak torso_roll", **ROLL_PITCH, overshoot=16),
    entry("position-own-gains", "PositionControlAccuracy", **TORSO, Kp=0.05, Kd=0),
    entry("position-too-short", "PositionControlAccuracy", **TORSO, step_duration=0.6),
    entry("external", "PositionControlAccuracyExternalPid", **NECK),
    entry("external-late", "PositionControlAccuracyExternalPid", "latency /icubSim/head/stateExt:o", **NECK),
    entry("external-weak", "PositionControlAccuracyExternalPid", **NECK, Kp=0.01, Ki=0.03),
    entry("torque", "TorqueControlAccuracy", **TORSO),
    entry("torque-scale", "TorqueControlAccuracy", "torque_scale torso_yaw factor=0.5", **TORSO),
    entry("torque-head", "TorqueControlAccuracy", part="head"),
    entry("torque-finger", "TorqueControlAccuracy", part="left_arm", joints="(3 9)"),
])  # fmt: skip


@pytest.fixture(scope="module")
def outcome(run_on_robot):
    """One robot for all of them."""
    return run_on_robot(SUITE, parts="head,left_arm,torso")


@pytest.mark.parametrize("name", ["position", "external", "torque"])
def test_a_healthy_joint_passes(outcome, name):
    """Its response is within the default limits."""
    assert outcome.verdict(name) is Verdict.PASSED, outcome.detail(name)


@pytest.mark.parametrize(
    ("name", "height", "unit"), [("position", 2.0, "deg"), ("external", 4.0, "deg"), ("torque", 0.5, "Nm")]
)
def test_a_step_is_a_step(outcome, name, height, unit):
    """The command is constant before time 0 and higher by the step after it, and the measured value follows."""
    recorded = [event for event in outcome.of(SeriesRecorded) if event.test.endswith(f"/{name}")]
    assert len(recorded) == 2
    for event in recorded:
        with np.load(outcome.folder / event.path) as data:
            time, commanded, measured = data["time"], data["commanded"], data["measured"]
        before, after = commanded[time < -0.005], commanded[time > 0.005]
        assert np.ptp(before) == np.ptp(after) == 0
        assert abs(after[0] - before[0]) == pytest.approx(height)
        assert abs(measured[-1] - measured[time < 0].mean()) == pytest.approx(height, rel=0.2)
        assert {column["unit"] for column in event.columns} == {"s", unit}


@pytest.mark.parametrize(
    ("name", "joint"),
    [
        ("position-gains", "torso_yaw"),
        ("position-jam", "torso_yaw"),
        ("position-own-gains", "torso_yaw"),
        ("external-late", "neck_yaw"),
        ("external-weak", "neck_yaw"),
        ("torque-scale", "torso_yaw"),
    ],
)
def test_a_fault_is_found_at_its_joint(outcome, name, joint):
    """Wrong gains, a joint that does not move, late states, a sensor with a wrong factor."""
    assert outcome.verdict(name) is Verdict.FAILED, outcome.detail(name)
    failures = [event for event in outcome.of(Message, severity=Severity.FAILURE) if event.test.endswith(f"/{name}")]
    assert failures
    assert {event.subject for event in failures} == {joint}


def test_what_cannot_be_tested_is_no_failure(outcome):
    """A step that is too short to be judged is an error that names the parameter; a part without torques is skipped."""
    assert outcome.verdict("position-too-short") is Verdict.ERROR
    assert "step_duration" in outcome.detail("position-too-short")
    assert outcome.verdict("torque-head") is Verdict.SKIPPED
    assert "torque control" in outcome.detail("torque-head")
    assert outcome.verdict("torque-finger") is Verdict.ERROR
    assert "l_thumb_proximal" in outcome.detail("torque-finger")


def test_a_joint_is_not_failed_for_a_motor_that_it_shares(outcome):
    """The torque constant of one motor explains what both of its joints do; the joint of that motor fails."""
    ended = {event.subject: event for event in outcome.of(SubResultEnded, test="s/position-weak")}
    assert ended["torso_roll"].verdict is Verdict.FAILED, ended["torso_roll"].reason
    assert ended["torso_pitch"].verdict is Verdict.INCONCLUSIVE, ended["torso_pitch"].reason
    assert "overshoot is" in ended["torso_pitch"].reason
    assert "the motor of torso_roll: its torque constant is" in ended["torso_pitch"].reason
