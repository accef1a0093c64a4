"""The model of a motor, from states of a winding that is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot.model.drives import Drive
from rtf.robot_testing.judging.motor_model import MotorModel, MotorRun, WrongMotor, motor_model, wrong_motor

SUPPLY, RESISTANCE, CONSTANT = 24.0, 3.0, 0.03
DRIVE = Drive("current", SUPPLY, RESISTANCE, CONSTANT, 0.01, 0.001, assumed=False, turns=100.0)
NOISE = 0.01  # A
SHARES = st.floats(0.2, 3.0)


def states(*, count: int = 600, load: float = 0.3, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Duty cycles (per cent), currents (A) and speeds (deg/s) of a motor that turns to and fro, slowly and fast."""
    random = np.random.default_rng(seed)
    time = np.linspace(0.0, 6.0, count)
    speeds = np.where(time < 3.0, 4000.0, 10000.0) * np.sin(2 * math.pi * time)
    currents = load * np.sin(time) + 0.2 * np.sign(speeds) + 0.1 * random.standard_normal(count)
    duties = (RESISTANCE * currents + CONSTANT * np.radians(speeds)) * 100.0 / SUPPLY
    return duties, currents + NOISE * random.standard_normal(count), speeds


def fitted(duties: np.ndarray, currents: np.ndarray, speeds: np.ndarray) -> MotorModel:
    """The model of these states."""
    return motor_model(MotorRun(duties, currents, speeds, DRIVE, SUPPLY))


def test_a_healthy_motor_is_what_its_drive_says():
    """All shares are 1, and nothing is shown without a current."""
    found = fitted(*states())
    assert (found.upwards, found.downwards, found.constant) == pytest.approx((1.0, 1.0, 1.0), abs=0.02)
    assert found.offset == pytest.approx(0.0, abs=0.005)
    assert found.gain == pytest.approx(1.0, abs=0.02)
    assert found.uneven == pytest.approx(0.0, abs=0.02)


@given(factor=st.one_of(SHARES, SHARES.map(lambda share: -share)), offset=st.floats(-1.0, 1.0))
def test_a_sensor_shows_its_scale_its_sign_and_its_offset(factor: float, offset: float):
    """And the torque constant all the same."""
    duties, currents, speeds = states()
    found = fitted(duties, factor * currents + offset, speeds)
    assert found.gain == pytest.approx(factor, rel=0.03)
    assert found.offset == pytest.approx(offset, abs=0.02 * abs(factor) + 1e-3)
    assert found.constant == pytest.approx(1.0, abs=0.03)


@given(share=st.floats(0.2, 1.0), way=st.sampled_from([1.0, -1.0]))
def test_a_weak_direction_is_told_from_the_other_one(share: float, way: float):
    """By duty cycles that are higher in that direction for the same current; the sensor is not accused."""
    duties, currents, speeds = states()
    duties = np.where(way * duties > 0.0, duties / share, duties)
    found = fitted(duties, currents, speeds)
    assert found.gain == pytest.approx(1.0, abs=0.03)
    assert found.uneven == pytest.approx(-way * (1.0 - share), abs=0.03)


def test_weak_magnets_show_in_the_torque_constant():
    """They induce less; the winding, and so the current at rest, is the same."""
    duties, currents, speeds = states()
    duties -= 0.7 * CONSTANT * np.radians(speeds) * 100.0 / SUPPLY
    found = fitted(duties, currents, speeds)
    assert found.constant == pytest.approx(0.3, abs=0.02)
    assert found.gain == pytest.approx(1.0, abs=0.03)


def test_a_dead_sensor_has_no_scale():
    """Not even with noise; neither has it a direction that is weaker, nor a constant."""
    duties, currents, speeds = states()
    dead = fitted(duties, 0.0 * currents, speeds)
    assert (dead.gain, dead.offset) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert math.isnan(dead.uneven)
    noisy = fitted(duties, np.random.default_rng(1).normal(0.0, NOISE, len(duties)), speeds)
    assert abs(noisy.gain) < 0.02


def test_single_wrong_states_do_not_count():
    """One of twenty shows any current."""
    duties, currents, speeds = states()
    currents[::20] = np.random.default_rng(2).uniform(-10.0, 10.0, len(currents[::20]))
    found = fitted(duties, currents, speeds)
    assert (found.upwards, found.downwards, found.constant) == pytest.approx((1.0, 1.0, 1.0), abs=0.03)


def test_what_the_motion_does_not_show_is_unknown():
    """A direction in which nothing drove, a speed that did not change, and a motor that stood without a duty cycle."""
    duties, currents, speeds = states()
    up = duties > 0.0
    one_way = fitted(duties[up], currents[up], speeds[up])
    assert one_way.upwards == pytest.approx(1.0, abs=0.05)
    assert math.isnan(one_way.downwards)
    assert math.isnan(one_way.uneven)
    assert math.isnan(one_way.offset)
    blocked = fitted(currents * RESISTANCE * 100.0 / SUPPLY, currents, 0.0 * speeds)
    assert blocked.gain == pytest.approx(1.0, abs=0.02)
    assert math.isnan(blocked.constant)
    still = fitted(0.0 * duties, 0.0 * currents, speeds)
    assert math.isnan(still.gain)
    assert math.isnan(still.uneven)


def wrong(duties: np.ndarray, currents: np.ndarray, speeds: np.ndarray) -> str:
    """What is said of the motor."""
    found = wrong_motor(MotorRun(duties, currents, speeds, DRIVE, SUPPLY))
    return found.text if found else ""


def test_a_healthy_motor_is_not_accused():
    """Nor one whose winding has 25 % more resistance, nor one that rests."""
    duties, currents, speeds = states()
    noise = NOISE * np.random.default_rng(6).standard_normal(len(duties))
    assert wrong(duties, currents, speeds) == ""
    assert wrong(duties + 0.25 * RESISTANCE * currents * 100.0 / SUPPLY, currents, speeds) == ""
    assert wrong(0.0 * duties, noise, 0.0 * speeds) == ""


def test_a_motor_whose_current_hardly_changes_is_judged_by_its_level_and_its_speed():
    """It holds a joint that another one pulls; its duty cycle shows its winding at rest, its amplifier at a speed."""
    random = np.random.default_rng(8)
    held = 0.5 + NOISE * random.standard_normal(500)
    speeds = np.repeat([0.0, 2000.0, -1000.0, 0.0, 1500.0], 100)

    def duties(resistance: float, amplifier: float) -> np.ndarray:
        return (resistance * 0.5 + CONSTANT * np.radians(speeds)) * 100.0 / SUPPLY / amplifier

    assert wrong(duties(RESISTANCE, 1.0), held, speeds) == ""
    assert wrong(duties(1.2 * RESISTANCE, 1.0), held, speeds) == ""
    assert wrong(duties(4.0 * RESISTANCE, 1.0), held, speeds).startswith(
        "its current is 0.5 A where its duty cycle drives 2"
    )
    assert (
        wrong(duties(RESISTANCE, 0.72), held, speeds)
        == "it needs 139% of the duty cycle that its drive needs for a speed"
    )
    assert wrong(duties(RESISTANCE, 1.0), held, speeds + 500.0 * random.standard_normal(500)) == ""


def test_duty_cycles_that_change_from_state_to_state_accuse_nobody():
    """A joint that is shaken: the current belongs to another duty cycle than the one beside it."""
    duties = 80.0 * np.resize([1.0, 0.4, -1.0, -0.6], 500)
    driven = duties * SUPPLY / 100.0 / RESISTANCE
    assert wrong(duties, np.roll(0.5 * driven, 1), np.zeros(500)) == ""


def test_noise_does_not_accuse_a_motor():
    """Of speeds, where the current hardly changes; of duty cycles that last for a millisecond, not for a state."""
    duties, currents, speeds = states()
    shaken = 1400.0 * np.random.default_rng(5).standard_normal(len(duties))
    held = 0.2 + NOISE * np.random.default_rng(6).standard_normal(len(duties))
    by_speed = (RESISTANCE * held + CONSTANT * np.radians(shaken)) * 100.0 / SUPPLY
    seen = shaken + 300.0 * np.random.default_rng(7).standard_normal(len(duties))
    assert fitted(by_speed, held, seen).gain < 0.3
    assert wrong(by_speed, held, seen) == ""
    other = 40.0 * np.random.default_rng(3).standard_normal((2, len(duties)))
    assert wrong(duties + other[0], currents + other[1] * SUPPLY / RESISTANCE / 100.0, speeds) == ""


def test_what_a_motor_does_not_do_as_its_drive_says_is_described():
    """The winding first, then the amplifier, then the magnets."""
    duties, currents, speeds = states()
    noise = NOISE * np.random.default_rng(6).standard_normal(len(duties))
    induced = CONSTANT * np.radians(speeds) * 100.0 / SUPPLY
    assert wrong(duties, noise, speeds) == "it has no current"
    assert wrong(duties, -currents, speeds) == "its current is -100% of what its duty cycle drives"
    assert wrong(np.where(duties < 0.0, 2.0 * duties, duties), currents, speeds).startswith("a negative duty cycle")
    assert wrong(np.where(duties > 0.0, 2.0 * duties, duties), currents, speeds).startswith("a positive duty cycle")
    assert wrong(duties - 0.7 * induced, currents, speeds) == "its torque constant is 30% of that in robot.toml"
    assert wrong(duties - 2.0 * induced, currents, speeds) == "its torque constant is -100% of that in robot.toml"


def test_a_current_that_is_interrupted_is_a_loose_contact():
    """Three states are; one or two may be of a duty cycle that is shown before its current."""
    duties, currents, speeds = states()
    hard = np.flatnonzero(np.abs(duties) > 15.0)
    for count, found in ((0, False), (2, False), (3, True), (20, True)):
        open_circuit = currents.copy()
        open_circuit[hard[:count]] = 0.0
        duties_then = duties.copy()
        duties_then[hard[:count]] = np.sign(duties[hard[:count]]) * 100.0
        wrong = wrong_motor(MotorRun(duties_then, open_circuit, speeds, DRIVE, SUPPLY))
        text = f"it has no current in {count} of 600 states, and a duty cycle for one"
        assert wrong == (WrongMotor(text, "loose contact") if found else None)


def test_a_current_that_changes_its_sign_has_no_loose_contact():
    """A controller that drives to and fro changes it often, and the current is shown a state later."""
    duties = np.where(np.arange(600) // 5 % 2, 100.0, -100.0)
    currents = duties * SUPPLY / (100.0 * DRIVE.resistance)
    late = np.roll(currents, 1)
    late[1:][np.diff(duties) != 0.0] = 0.0  # on its way from one to the other
    found = wrong_motor(MotorRun(duties, late, np.zeros(600), DRIVE, SUPPLY))
    assert found is None or found.finding != "loose contact"
