"""JointSweep on the simulated robot."""

import numpy as np
import pytest

from icub import PARTS
from robot_outcomes import failed_parts, said
from rtf.testing.events import SeriesRecorded
from rtf.testing.verdict import Verdict

TORSO = '<parameter name="part">torso</parameter>'


def entry(name, inject="", where=TORSO, more=""):
    """A test of the suite."""
    inject = f'<parameter name="inject">"{inject}"</parameter>'
    return f'<test name="{name}"> {where} {inject} {more} JointSweep </test>'


SUITE = "".join([
    entry("healthy"),
    entry("eccentric", "encoder_eccentric torso_yaw amplitude=1"),
    entry("spikes", "motor_encoder_spikes torso_yaw height=500 rate=5"),
    entry("late", "motor_encoder_late torso_yaw age=0.01", more='<parameter name="joints">(0)</parameter>'),
])  # fmt: skip


@pytest.fixture(scope="module")
def outcome(run_on_robot):
    """The suite above, run once."""
    return run_on_robot(SUITE, parts="torso")


def test_a_healthy_torso_is_swept_from_end_to_end(outcome, measured):
    """Also its coupled joints agree with their motors all the way; each was near both of its limits."""
    assert outcome.verdict("healthy") is Verdict.PASSED, outcome.detail("healthy")
    for axis in PARTS["torso"]:
        (error,) = measured(outcome, "healthy", "error over the range", axis.name)
        assert error.value < 0.05
        (series,) = outcome.of(SeriesRecorded, name="disagreement of the encoders", subject=axis.name, test="s/healthy")
        with np.load(outcome.folder / series.path) as data:
            assert data["joint"].min() == pytest.approx(axis.minimum + 2.0, abs=1.5)
            assert data["joint"].max() == pytest.approx(axis.maximum - 2.0, abs=1.5)


def test_an_eccentric_magnet_is_named_and_measured(outcome):
    """Of one degree, and at its joint only."""
    assert failed_parts(outcome, "eccentric") == ["torso_yaw"]
    assert "eccentric magnet of the joint encoder would, by 1.0" in said(outcome, "eccentric")


def test_spikes_are_counted_at_the_encoder_that_has_them(outcome, measured):
    """A spike of five degrees is no frozen encoder, and what it hides is judged all the same."""
    assert failed_parts(outcome, "spikes") == ["torso_yaw"]
    (motors,) = measured(outcome, "spikes", "spikes of the motor encoder", "torso_yaw")
    (joints,) = measured(outcome, "spikes", "spikes of the joint encoder", "torso_yaw")
    assert motors.value > 5
    assert joints.value == 0
    (error,) = measured(outcome, "spikes", "error over the range", "torso_yaw")
    assert error.value < 0.05


def test_the_delay_of_a_late_encoder_is_measured(outcome, measured):
    """Ten milliseconds, of the motor: the joint encoder is ahead."""
    (delay,) = measured(outcome, "late", "delay of the joint encoder", "torso_yaw")
    assert delay.value == pytest.approx(-10.0, abs=0.5)
    assert "the motor encoder is 10" in said(outcome, "late")
