"""JointSweep on the simulated robot."""

import numpy as np
import pytest

from icub import PARTS
from robot_outcomes import failed_parts, said
from rtf.testing.events import SeriesRecorded
from rtf.testing.verdict import Verdict

TORSO = '<parameter name="part">torso</parameter>'

YAW = '<parameter name="joints">(0)</parameter>'


def entry(name, inject="", where=TORSO, more=""):
    """A test of the suite."""
    inject = f'<parameter name="inject">"{inject}"</parameter>'
    return f'<test name="{name}"> {where} {inject} {more} JointSweep </test>'


SUITE = "".join([
    entry("healthy"),
    entry("spikes", "motor_encoder_spikes torso_yaw height=500 rate=5", more=YAW),
    entry("sticky", "sticky_place torso_yaw torque=5 place=0.3", more=YAW),
    entry("jams", "jam_at_times torso_yaw length=0.04 rate=2", more=YAW),
    entry("sensor", "current_sensor_gain torso_yaw factor=0.6", more=YAW),
    entry("amplifier", "amplifier_weak torso_yaw share=0.7 direction=-1", more=YAW),
])  # fmt: skip


@pytest.fixture(scope="module")
def outcome(run_on_robot):
    """The suite above, run once."""
    return run_on_robot(SUITE, parts="torso")


def test_a_healthy_torso_is_swept_from_end_to_end(outcome, measured):
    """Coupled joints agree with their motors on the whole way; each joint comes near both limits."""
    assert outcome.verdict("healthy") is Verdict.PASSED, outcome.detail("healthy")
    for axis in PARTS["torso"]:
        (error,) = measured(outcome, "healthy", "error over the range", axis.name)
        assert error.value < 0.05
        (dry,) = measured(outcome, "healthy", "dry friction", axis.name)
        assert dry.value == pytest.approx(100.0 * axis.friction / axis.max_torque, rel=0.1)
        for what in ("current for its duty cycle", "torque constant"):
            (share,) = measured(outcome, "healthy", what, axis.name)
            assert share.value == pytest.approx(100.0, abs=6.0)
        (series,) = outcome.of(SeriesRecorded, name="disagreement of the encoders", subject=axis.name, test="s/healthy")
        with np.load(outcome.folder / series.path) as data:
            assert data["joint"].min() == pytest.approx(axis.minimum + 2.0, abs=1.5)
            assert data["joint"].max() == pytest.approx(axis.maximum - 2.0, abs=1.5)


def test_spikes_are_counted_at_the_encoder_that_has_them(outcome, measured):
    """Spikes of five degrees do not count as a frozen encoder, and the other checks go on."""
    assert failed_parts(outcome, "spikes") == ["torso_yaw"]
    (motors,) = measured(outcome, "spikes", "spikes of the motor encoder", "torso_yaw")
    (joints,) = measured(outcome, "spikes", "spikes of the joint encoder", "torso_yaw")
    assert motors.value > 5
    assert joints.value == 0
    (error,) = measured(outcome, "spikes", "error over the range", "torso_yaw")
    assert error.value < 0.05


def test_a_sticky_place_is_found_where_it_is(outcome, measured):
    """Of 5 Nm, a tenth of what the motor has, at 30 % of the range."""
    (more,) = measured(outcome, "sticky", "additional friction in one place", "torso_yaw")
    assert more.value == pytest.approx(10.0, abs=3.0)
    assert "more at -2" in said(outcome, "sticky")
    assert "in both directions" in said(outcome, "sticky")


def test_a_jam_that_comes_and_goes_is_no_sticky_place(outcome):
    """It is found in the move that it stopped, at a place that the next move passes."""
    assert failed_parts(outcome, "jams") == ["torso_yaw"]
    assert "in one of its moves, and not in the others" in said(outcome, "jams")


def test_a_current_sensor_is_told_from_an_amplifier(outcome, measured):
    """The first shows a part of the current in both directions, with the second one direction needs more duty cycle."""
    assert failed_parts(outcome, "sensor") == failed_parts(outcome, "amplifier") == ["torso_yaw"]
    shown, difference = "current for its duty cycle", "difference of the directions"
    values = {
        (test, what): measured(outcome, test, what, "torso_yaw")[0].value
        for test in ("sensor", "amplifier")
        for what in (shown, difference)
    }
    assert values["sensor", shown] == pytest.approx(60.0, abs=4.0)
    assert values["sensor", difference] == pytest.approx(0.0, abs=3.0)
    assert values["amplifier", shown] == pytest.approx(100.0, abs=6.0)
    assert values["amplifier", difference] == pytest.approx(30.0, abs=3.0)
    assert "wrong scale" in said(outcome, "sensor")
    assert "a negative duty cycle drives" in said(outcome, "amplifier")
