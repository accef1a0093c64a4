"""The judgement of motors, their currents and encoders, by JointSweep, for known states."""

from __future__ import annotations

import sys
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from rtf.robot_testing.guard.transmission import Transmission
from rtf.testing.verdict import Inconclusive

from .judging.test_motor_model import DRIVE, SUPPLY, states
from .kept_test import kept_test

PEAK = 8.0  # A


def judged(duties: np.ndarray, currents: np.ndarray, speeds: np.ndarray, *, known: bool) -> SimpleNamespace:
    """What the test says of a motor with these states, whose winding robot.toml says, or not."""
    motor = SimpleNamespace(drive=DRIVE, supply=SUPPLY, peak=PEAK, known=known)
    test = kept_test("JointSweep", motors={0: motor})
    columns = {"duties": duties, "currents": currents, "speeds": speeds}
    own = SimpleNamespace(
        time=0.01 * np.arange(len(duties)), **{name: column[:, None] for name, column in columns.items()}
    )
    test._judge_motor("elbow", 0, own)
    return test.kept


@pytest.mark.parametrize("known", [True, False])
def test_a_healthy_motor_passes(known: bool):
    """All five numbers are measured."""
    kept = judged(*states(), known=known)
    assert not kept.failures
    assert len(kept.values) == 5


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_without_a_winding_in_robot_toml_the_scale_is_not_judged(factor: float):
    """It is measured: another resistance is as likely as a wrong sensor."""
    duties, currents, speeds = states()
    assert not judged(duties, factor * currents, speeds, known=False).failures
    (failure,) = judged(duties, factor * currents, speeds, known=True).failures
    assert f"elbow: the current is {100 * factor:.0f} % of what the duty cycle drives; likely: " in failure


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize(
    ("factor", "words"),
    [(0.0, "the current does not follow the duty cycle"), (-1.0, "the sign opposite to the duty cycle")],
)
def test_a_dead_sensor_and_a_wrong_sign_are_found_on_any_motor(known: bool, factor: float, words: str):
    """No winding explains them."""
    duties, currents, speeds = states()
    (failure,) = judged(duties, factor * currents, speeds, known=known).failures
    assert words in failure


@pytest.mark.parametrize("known", [True, False])
def test_an_offset_and_a_weak_direction_are_found_on_any_motor(known: bool):
    """Each is named, and nothing else."""
    duties, currents, speeds = states()
    (failure,) = judged(duties, currents + 0.05 * PEAK, speeds, known=known).failures
    assert "the current is 0.4 A where none flows" in failure
    (failure,) = judged(np.where(duties > 0.0, duties / 0.6, duties), currents, speeds, known=known).failures
    assert "a positive duty cycle drives 40 % less current" in failure


def test_weak_magnets_are_found_where_the_constant_is_known():
    """By the voltage that a speed induces."""
    duties, currents, speeds = states()
    weaker = duties - 0.6 * DRIVE.torque_constant * np.radians(speeds) * 100.0 / SUPPLY
    (failure,) = judged(weaker, currents, speeds, known=True).failures
    assert "elbow: the torque constant is 40 % of that in robot.toml" in failure
    assert not judged(weaker, currents, speeds, known=False).failures


def test_a_motor_that_was_not_driven_is_not_judged():
    """But for the noise of its current."""
    duties, currents, speeds = states()
    assert judged(0.0 * duties, currents, speeds, known=True).values.keys() == {"noise of the current"}


def test_noise_of_a_current_is_found_where_the_winding_is_known():
    """Beyond what the duty cycles explain, which are noisy where an encoder is."""
    duties, currents, speeds = states()
    random = np.random.default_rng(3)
    kept = judged(duties, currents + random.normal(0.0, 0.5, len(duties)), speeds, known=True)
    assert "elbow: the current jumps by" in kept.failures[0]
    assert kept.values["noise of the current"] == pytest.approx(0.5, rel=0.15)
    assert not judged(duties, currents + random.normal(0.0, 0.5, len(duties)), speeds, known=False).failures
    jumping = random.normal(0.0, 5.0, len(duties))
    assert not judged(
        duties + jumping, currents + jumping * SUPPLY / 100.0 / DRIVE.resistance, speeds, known=True
    ).failures


@pytest.mark.parametrize("wrong", [None, 0, 1])
def test_the_motor_encoder_of_a_neighbour_is_no_fault_of_a_joint(wrong: int | None):
    """Both motors turn both joints: by both a joint disagrees if one of them is wrong, by its own one only then."""
    coupled = Transmission(np.full(2, 100.0), np.array([[0.5, -0.5], [0.5, 0.5]]), ((0, 1), (0, 1)))
    time = np.arange(0.0, 4.0, 0.01)
    positions = np.column_stack([np.zeros(time.size), 30.0 * np.sin(2.0 * time)])
    turns = coupled.rotors(positions)
    if wrong is not None:
        turns[:, wrong] *= 1.1
    zeros = np.zeros_like(positions)
    trace = SimpleNamespace(
        time=time, local_time=time, positions=positions, motor_positions=turns, motor_velocities=zeros,
        duty_cycles=zeros, currents=zeros, control_modes=zeros,
        newest=(0.0, SimpleNamespace(valid=np.ones(32, dtype=bool))),
    )  # fmt: skip
    test = kept_test("JointSweep", transmission=coupled, robot_part=SimpleNamespace(names=["roll", "pitch"]))
    test._sweeps = {0: None, 1: None}
    test._broken = lambda joint: f"encoders of {test.robot_part.names[joint]} disagree" if joint == wrong else ""
    states = sys.modules[type(test).__module__]._States.of(trace, coupled)
    with pytest.raises(Inconclusive, match="encoders of roll disagree") if wrong == 0 else nullcontext():
        test._end_if_another_motor(1, states)


def test_an_encoder_that_shows_nothing_agrees_with_none():
    """What motors say of a joint by the encoder of another one is not known then, and breaks nothing."""
    test = kept_test("JointSweep")
    time = np.arange(0.0, 4.0, 0.01)
    joints = 30.0 * np.sin(2.0 * time)
    assert not test._disagree(time, joints, joints)
    assert test._disagree(time, joints, np.where(time == time[7], np.nan, joints))
