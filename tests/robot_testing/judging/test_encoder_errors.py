"""Errors of encoders over a sweep, on motions that are computed: each cause is told from the others, with its size."""

import numpy as np
import pytest

from rtf.robot_testing.judging.encoder_errors import errors_of, spikes_of

PERIOD = 0.01
#: Steps of the joint's and of the motor's encoder, deg of the joint; the joint's is a coarse one of 12 bits.
STEP, ROTOR_STEP = 360 / 4096, 0.01


def sweep(low=-40.0, high=60.0):
    """A slow move upwards and a fast one back, minimum jerk, with a rest at each end: times and angles (deg)."""
    moves = [(low, high, 2.5), (high, high, 0.3), (high, low, 1.0), (low, low, 0.3)]
    angles = []
    for begin, end, seconds in moves:
        s = np.arange(round(seconds / PERIOD)) * PERIOD / seconds
        angles.append(begin + (end - begin) * (10 * s**3 - 15 * s**4 + 6 * s**5))
    whole = np.concatenate(angles)
    return PERIOD * np.arange(len(whole)), whole


def speed_of(angle):
    """The speeds (deg/s)."""
    return np.gradient(angle, PERIOD)


def lost(angle, share, above):
    """What an encoder shows that loses a share of its counts above a speed."""
    way = np.diff(angle, prepend=angle[0])
    return angle - np.cumsum(np.where(np.abs(speed_of(angle)) > above, share * way, 0.0))


def judged(joint, motor, time):
    """The errors of two encoders with their steps."""
    joint, motor = STEP * np.rint(joint / STEP), ROTOR_STEP * np.rint(motor / ROTOR_STEP)
    _, _, near = spikes_of(joint, motor, 0.5)
    return errors_of(time, joint, motor, near)


def test_healthy_encoders_agree_within_their_steps():
    """A step of the coarser encoder is all the error there is, and its rounding is no delay."""
    time, angle = sweep()
    found = judged(angle, angle + 3.0, time)
    assert found.error < 1.2 * STEP
    assert abs(found.delay) < 0.0005
    assert found.play < 0.05


@pytest.mark.parametrize("phase", [0.0, 45.0, 90.0])
def test_an_eccentric_magnet_is_recognized_at_any_phase(phase):
    """Also where the sine is straight, as the ratio is known, or bent."""
    time, angle = sweep()
    found = judged(angle + 2.0 * np.sin(np.radians(angle + phase)), angle, time)
    assert float(found.cause.split("eccentric magnet of the joint encoder would, by ")[1].split()[0]) == pytest.approx(
        2.0, abs=0.05
    )
    assert found.error > 0.5


@pytest.mark.parametrize(("share", "above"), [(0.05, 40.0), (0.02, 90.0)])
@pytest.mark.parametrize("whose", ["joint", "motor"])
def test_lost_counts_are_those_of_one_encoder(share, above, whose):
    """The sign of the error says which encoder lost them; its size, which share."""
    time, angle = sweep()
    wrong = lost(angle, share, above)
    found = judged(*((wrong, angle) if whose == "joint" else (angle, wrong)), time)
    assert f"the {whose} encoder loses" in found.cause
    assert found.error > 0.5


def test_a_drift_and_a_ratio_are_told_apart():
    """One grows with time, also on the way back; the other one with the angle."""
    time, angle = sweep()
    assert "drifts" in judged(angle + 0.3 * time, angle, time).cause
    assert "in proportion to the angle" in judged(1.02 * angle, angle, time).cause


@pytest.mark.parametrize("delay", [-0.02, 0.006])
def test_a_delay_is_measured_and_is_no_error(delay):
    """The encoder that is behind is the one whose delay is positive; play beside it changes nothing."""
    time, angle = sweep()
    behind = np.interp(time - abs(delay), time, angle)
    joint, motor = (behind, angle) if delay > 0 else (angle, behind)
    found = judged(joint, motor + np.where(time < 2.8, 0.4, -0.4), time)
    assert found.delay == pytest.approx(delay, abs=0.001)
    assert found.play == pytest.approx(0.8, abs=0.15)
    assert found.error < 0.4


@pytest.mark.parametrize("whose", ["joint", "motor"])
def test_spikes_belong_to_the_encoder_that_jumps(whose):
    """They are counted, and the rest is judged without them."""
    time, angle = sweep()
    wrong = angle.copy()
    wrong[[50, 120, 121, 300]] += [1.0, -3.0, -3.0, 2.0]
    joint, motor = (wrong, angle) if whose == "joint" else (angle, wrong)
    of_joint, of_motor, near = spikes_of(joint, motor, 0.5)
    own, other = (of_joint, of_motor) if whose == "joint" else (of_motor, of_joint)
    assert (own.number, other.number) == (4, 0)
    assert own.largest == pytest.approx(3.0, abs=0.2)
    assert errors_of(time, joint, motor, near).error < 0.1


def test_noise_is_no_spike():
    """However strong it is: what is usual does not stand out."""
    time, angle = sweep()
    noisy = angle + np.random.default_rng(1).normal(0.0, 0.5, len(time))
    of_joint, of_motor, _ = spikes_of(noisy, angle, 0.5)
    assert of_joint.number + of_motor.number == 0


def test_an_error_without_a_form_has_no_cause():
    """A reading that jumped once, on the way: it is measured, and nothing is guessed."""
    time, angle = sweep()
    found = judged(angle + 3.0 * ((time > 1.0) & (time < 1.6)), angle, time)
    assert found.error > 1.0
    assert not found.cause
