"""MotorEncodersSignCheck on the simulated robot."""

import numpy as np
import pytest

from robot_outcomes import failed_parts, said
from rtf.testing.events import SeriesRecorded
from rtf.testing.verdict import Verdict

ARM = '<parameter name="part">left_arm</parameter> <parameter name="joints">(1 3)</parameter>'


def entry(name, inject="", more=""):
    """A test of the suite."""
    return (
        f'<test name="{name}"> {ARM} <parameter name="inject">"{inject}"</parameter> {more} '
        "MotorEncodersSignCheck </test>"
    )


SUITE = "".join([
    entry("healthy"),
    entry("motor-encoder", "motor_encoder_sign l_shoulder_roll"),
    entry("joint-encoder", "encoder_sign l_elbow"),
    entry("gear", "wrong_gear_ratio l_elbow factor=-1"),
    entry("motor", "motor_sign l_elbow"),
    entry("dead", "motor_dead l_elbow", '<parameter name="pwmMax">15</parameter>'),
    entry("misspelt", more='<parameter name="Posthreshold">(4 4)</parameter> <parameter name="pwmMax">(9)</parameter>'),
    entry("too-many", more='<parameter name="pwmStep">(1 1 1)</parameter>'),
])  # fmt: skip


@pytest.fixture(scope="module")
def outcome(run_on_robot):
    """The suite above, run once."""
    return run_on_robot(SUITE, parts="left_arm")


def test_a_healthy_arm_follows_both_signs(outcome, measured):
    """Motor and joint turn with the sign of the duty cycle, by about the distance that ends a ramp."""
    assert outcome.verdict("healthy") is Verdict.PASSED, outcome.detail("healthy")
    for joint in ("l_shoulder_roll", "l_elbow"):
        for sign in ("positive", "negative"):
            for what in ("motor", "joint"):
                (found,) = measured(outcome, "healthy", f"{what} follows a {sign} duty cycle", joint)
                assert found.value == pytest.approx(5.0, abs=2.5)


def test_the_duty_cycles_grow_in_steps_from_what_holds_the_joint(outcome):
    """Up in the first ramp, down in the second, a per cent at a time; and the joint waits where it was held."""
    for sign, word in ((1.0, "positive"), (-1.0, "negative")):
        (series,) = outcome.of(SeriesRecorded, name=f"{word} duty cycle", subject="l_elbow", test="s/healthy")
        with np.load(outcome.folder / series.path) as data:
            steps, motor = sign * np.diff(data["duty"]), data["motor"]
        assert set(np.round(steps, 6)) <= {0.0, 1.0, 2.0}
        assert steps.sum() >= 1.0
        assert abs(motor[0]) < 0.5


@pytest.mark.parametrize(
    ("name", "joint", "words"),
    [
        ("motor-encoder", "l_shoulder_roll", "encoder counts the wrong way"),
        ("joint-encoder", "l_elbow", "l_elbow is not driven: it was excluded and left idle"),
        ("gear", "l_elbow", "the joint turns against its motor"),
        ("motor", "l_elbow", "two wires of the motor exchanged"),
        ("dead", "l_elbow", "a broken motor cable"),
    ],
)
def test_each_wrong_sign_is_named_for_what_it_is(outcome, name, joint, words):
    """A motor's encoder, a joint's encoder, a gear, a motor: wrongs that look alike and are told apart.

    A joint that its motor cannot hold presses against its stop while another has its turn: it is released at once.
    """
    assert outcome.verdict(name) is Verdict.FAILED
    assert {*failed_parts(outcome, name)} == {joint}
    assert words in said(outcome, name)


def test_a_joint_that_does_not_obey_is_left_idle(outcome):
    """A controller that turns it the wrong way gets it back in no mode."""
    assert "l_elbow is left idle" in said(outcome, "motor")


def test_keys_of_shipped_files_are_taken(outcome, measured):
    """Also the misspelt one, which ends ramps earlier."""
    assert outcome.verdict("misspelt") is Verdict.PASSED, outcome.detail("misspelt")
    (found,) = measured(outcome, "misspelt", "motor follows a positive duty cycle", "l_elbow")
    assert found.value < 6.0


def test_a_list_of_the_wrong_length_is_an_error(outcome):
    """The error names the list, and nothing moves."""
    assert outcome.verdict("too-many") is Verdict.ERROR
    assert "pwmStep has 3 values" in outcome.detail("too-many")
