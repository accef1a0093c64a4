"""Imu on the simulated robot."""

import numpy as np
import pytest

from icub import robot_description
from robot_outcomes import failed_parts, said
from rtf.testing.events import Message, SeriesRecorded
from rtf.testing.verdict import Severity, Verdict


def case(name, inject="", **rows):
    """One test of a suite, which moves a part of the neck only."""
    given = {"axes": "(neck_pitch neck_yaw)", "speed": 40, "amplitude": 8, **rows}
    parameters = "".join(f'<parameter name="{key}">{value}</parameter>' for key, value in given.items())
    return f'<test name="{name}">{parameters}<parameter name="inject">"{inject}"</parameter> Imu </test>'


@pytest.fixture(scope="module")
def outcome(run_on_robot, tmp_path_factory):
    """One run of all of them."""
    model = tmp_path_factory.mktemp("model") / "turned.urdf"
    text = robot_description().read_text(encoding="utf-8")
    joint = text.index('<child link="head_imu_0"')
    begin = text.rindex("<joint", 0, joint)
    end = text.index("</joint>", joint)
    own = text[begin:end]
    before = own[own.index('rpy="') : own.index('"', own.index('rpy="') + 5)]
    model.write_text(text[:begin] + own.replace(before, 'rpy="0 0 0') + text[end:], encoding="utf-8")
    suite = "".join(
        [
            case("healthy", axes="(neck_pitch neck_roll neck_yaw)", amplitude=15),
            case("turned", "imu_rotated imu angle=20"),
            case("a-little", "imu_rotated imu angle=5"),
            case("frozen", "imu_frozen imu"),
            case("gain", "gyroscope_gain imu factor=0.85"),
            case("stuck", "jam neck_yaw"),
            case("model", model=model),
            case("unknown", sensors="(head_imu_7)"),
            case("parts", parts="(head)"),
            case("elsewhere", port="/icubSim/inertials"),
        ]
    )
    return run_on_robot(suite, parts="head,torso")


def test_a_healthy_unit_agrees_with_the_joints(outcome, measured):
    """Orientation, gravity and turning rate agree far better than they have to."""
    assert outcome.verdict("healthy") is Verdict.PASSED
    for name, most in (
        ("greatest error of the orientation", 0.02),
        ("greatest error of the direction of gravity", 2.0),
        ("rms error of the turning rate", 1.0),
        ("turn of its mounting", 0.1),
    ):
        assert measured(outcome, "healthy", name)[0].value < most


def test_a_wrong_gain_is_reported_for_each_axis(outcome, measured):
    """That of the gyroscope, about each axis about which the neck turns; the accelerometer is right."""
    assert outcome.verdict("gain") is Verdict.FAILED
    for axis in "xyz":
        (healthy,) = measured(outcome, "healthy", f"gain of angular velocity {axis}")
        assert healthy.value == pytest.approx(1.0, abs=0.01)
    assert {
        round(one.value, 2) for axis in "xyz" for one in measured(outcome, "gain", f"gain of angular velocity {axis}")
    } == {0.85}
    assert all(
        one.value == pytest.approx(1.0, abs=0.02)
        for axis in "xyz"
        for one in measured(outcome, "gain", f"gain of acceleration {axis}")
    )


def test_the_neck_is_really_moved(outcome, measured):
    """Each joint moves to both sides of home, and the unit turns with the requested speed."""
    for joint in ("neck_pitch", "neck_roll", "neck_yaw"):
        assert measured(outcome, "healthy", f"motion of {joint}")[0].value > 28
    (series,) = outcome.of(SeriesRecorded, test="s/healthy", name="turning rate")
    with np.load(outcome.folder / series.path) as columns:
        assert columns["expected"].max() > 35


def test_a_turned_unit_is_reported_with_its_angle(outcome):
    """The failure names the unit, and the angle and axis of its misalignment."""
    assert outcome.verdict("turned") is Verdict.FAILED
    said = [event.detail for event in outcome.of(Message, severity=Severity.FAILURE) if "misaligned" in event.detail]
    assert any("head_imu_0" in one and ("by 20." in one or "by 19." in one) for one in said), said


def test_a_unit_that_is_turned_a_little_is_found_by_its_turn(outcome, measured):
    """The angle has an interval much smaller than its excess over the limit, and likely causes."""
    (turn,) = measured(outcome, "a-little", "turn of its mounting")
    (interval,) = measured(outcome, "a-little", "interval of the turn of its mounting (99 %)")
    assert turn.value == pytest.approx(5.0, abs=interval.value)
    assert turn.value - turn.high > 1.5 > 10 * interval.value
    assert "is misaligned by 5.0 ± 0.0" in said(outcome, "a-little")
    assert "likely: an IMU mounted in another orientation" in said(outcome, "a-little")


def test_a_joint_that_is_stuck_fails_by_its_name(outcome, measured):
    """The unit is still judged by the other joints."""
    assert failed_parts(outcome, "stuck") == ["neck_yaw"]
    assert "neck_yaw (/icubSim/head joint 2) draws" in said(outcome, "stuck")
    assert "the motor of neck_yaw does not turn at a duty cycle of +100 %; likely: a broken" in said(outcome, "stuck")
    assert not measured(outcome, "stuck", "motion of neck_yaw")
    assert measured(outcome, "stuck", "turn of its mounting")[0].value < 0.5


def test_a_unit_that_stands_still_is_found(outcome, measured):
    """A unit that repeats its values while the head moves fails, and not as a misaligned one."""
    assert outcome.verdict("frozen") is Verdict.FAILED
    assert any("never changed" in event.detail for event in outcome.of(Message, test="s/frozen"))
    assert not measured(outcome, "frozen", "turn of its mounting")


def test_a_wrong_frame_in_the_model_is_found(outcome):
    """The test fails with a description in which the unit is mounted with another orientation."""
    assert outcome.verdict("model") is Verdict.FAILED


def test_what_cannot_be_tested_is_an_error(outcome):
    """A missing unit, and joints that carry it and belong to no part, are errors that name them."""
    assert outcome.verdict("unknown") is Verdict.ERROR
    assert "head_imu_7" in outcome.detail("unknown")
    assert outcome.verdict("parts") is Verdict.ERROR
    assert "torso_yaw" in outcome.detail("parts")


def test_units_that_are_elsewhere_are_named(outcome):
    """The error names the registered servers of sensors."""
    assert outcome.verdict("elsewhere") is Verdict.ERROR
    assert "/icubSim/inertials does not report its units" in outcome.detail("elsewhere")
    assert "; inertial units are at /icubSim/inertial: set the parameter port" in outcome.detail("elsewhere")
