"""FtSensorPostures on the simulated robot."""

import pytest

from robot_outcomes import said
from rtf.testing.verdict import Verdict

PORT = "/icubSim/left_arm/analog:o"
CASES = {
    "healthy": "",
    "gain": "ft_gain left_arm factor=0.8",
    "axes": "ft_axes left_arm",
    "jam": "jam l_shoulder_roll",
}
SUITE = "".join(
    f'<test name="{name}"><parameter name="inject">"{inject}"</parameter> FtSensorPostures </test>'
    for name, inject in CASES.items()
)


@pytest.fixture(scope="module")
def outcome(run_on_robot):
    """One run of all of them."""
    return run_on_robot(SUITE, parts="torso,left_arm")


def test_a_healthy_sensor_has_gains_of_one(outcome, measured):
    """All its forces and torques, by postures of up to three joints on both sides of home."""
    assert outcome.verdict("healthy") is Verdict.PASSED, outcome.detail("healthy")
    assert measured(outcome, "healthy", "postures")[0].value >= 5
    for what in ("force", "torque"):
        for axis in "xyz":
            (gain,) = measured(outcome, "healthy", f"gain of {what} {axis}")
            assert gain.value == pytest.approx(1.0, abs=0.01)
            assert gain.subject == PORT


def test_a_wrong_gain_is_reported(outcome, measured):
    """The gain of each channel is measured."""
    assert outcome.verdict("gain") is Verdict.FAILED
    gains = [one.value for what in ("force x", "torque z") for one in measured(outcome, "gain", f"gain of {what}")]
    assert gains == pytest.approx([0.8, 0.8], abs=0.01)
    assert f"{PORT}: its force y is 0.80 times what it should be" in said(outcome, "gain")


def test_exchanged_axes_are_named(outcome):
    """The axes of forces and of torques; the third axis passes."""
    assert outcome.verdict("axes") is Verdict.FAILED
    text = said(outcome, "axes")
    for one, other in (("x", "y"), ("y", "x")):
        assert f"{PORT}: its force {one} shows what is along {other}; likely: a wrong calibration matrix" in text
        assert f"{PORT}: its torque {one} shows what is along {other}" in text
    assert "its force z shows" not in text


def test_a_joint_that_does_not_move_is_named(outcome):
    """The guard stops it on its way to a posture; nothing is said of the sensor."""
    assert outcome.verdict("jam") is Verdict.FAILED
    assert "l_shoulder_roll" in outcome.detail("jam")
    assert PORT not in said(outcome, "jam")
