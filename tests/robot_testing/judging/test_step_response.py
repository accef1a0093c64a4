"""The characteristics of step responses."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot_testing.judging.step_response import noise_before, spread_of, step_response, with_noise

TIME = np.arange(-0.5, 3.0, 0.01)


def first_order(start, target, tau):
    """Return the response of a first-order system to a step at 0."""
    return np.where(TIME < 0, start, target + (start - target) * np.exp(-np.maximum(TIME, 0) / tau))


@given(
    start=st.floats(-50, 50),
    height=st.floats(0.5, 20) | st.floats(-20, -0.5),
    tau=st.floats(0.05, 0.3),
)
def test_a_first_order_response_has_the_textbook_characteristics(start, height, tau):
    """Rise ln 9 and delay ln(10/9) time constants, exponential settling, no overshoot."""
    target = start + height
    answer = step_response(TIME, first_order(start, target, tau), start, target, band=abs(height) * 0.05)
    assert answer.rise_time == pytest.approx(math.log(9) * tau, abs=0.01)
    assert answer.delay == pytest.approx(math.log(10 / 9) * tau, abs=0.01)
    assert answer.settling_time == pytest.approx(math.log(20) * tau, abs=0.02)
    assert answer.overshoot == pytest.approx(0.0, abs=1e-6)
    assert abs(answer.steady_error) < 0.01 * abs(height)
    assert answer.bandwidth == pytest.approx(0.35 / (math.log(9) * tau), rel=0.15)


def test_overshoot_error_and_ripple_are_told_apart():
    """A bump is overshoot, a shift at the end is an error, an oscillation about it is ripple."""
    values = np.where(TIME < 0, 0.0, 1.1) + np.where((TIME > 0.2) & (TIME < 0.3), 0.4, 0.0)
    values += np.where(TIME > 2.0, 0.02 * np.sin(2 * np.pi * 10 * TIME), 0.0)
    answer = step_response(TIME, values, 0.0, 1.0, band=0.2)
    assert answer.overshoot == pytest.approx(40.0, abs=0.1)
    assert answer.settling_time == pytest.approx(0.3, abs=0.011)
    assert answer.steady_error == pytest.approx(0.1, abs=0.003)
    assert answer.ripple == pytest.approx(0.02 / math.sqrt(2), rel=0.05)


def test_a_joint_at_rest_has_no_rise_and_never_settles():
    """Missing characteristics are NaN or infinite, not 0."""
    answer = step_response(TIME, np.zeros_like(TIME), 0.0, 2.0, band=0.1)
    assert math.isnan(answer.delay)
    assert math.isnan(answer.rise_time)
    assert answer.settling_time == math.inf
    assert answer.steady_error == pytest.approx(-2.0)


@pytest.mark.parametrize("reached", [0.6, 0.84, 1.3])
def test_delay_and_rise_refer_to_the_reached_value(reached):
    """The distance to the target is the steady-state error, and nothing else."""
    whole = step_response(TIME, first_order(0.0, 1.0, 0.1), 0.0, 1.0, band=0.1)
    answer = step_response(TIME, first_order(0.0, reached, 0.1), 0.0, 1.0, band=0.5)
    assert answer.delay == pytest.approx(whole.delay, abs=0.002)
    assert answer.rise_time == pytest.approx(whole.rise_time, abs=0.005)
    assert answer.overshoot == pytest.approx(0.0, abs=1e-3)
    assert answer.steady_error == pytest.approx(reached - 1.0, abs=1e-3)


def test_a_response_of_less_than_half_has_no_rise():
    """Otherwise noise about the start would have one."""
    answer = step_response(TIME, first_order(0.0, 0.4, 0.1), 0.0, 1.0, band=0.1)
    assert math.isnan(answer.rise_time)


@pytest.mark.parametrize("missing", [np.nan, np.inf])
@pytest.mark.parametrize("place", [10, 80, 340])
def test_values_that_are_not_finite_are_refused(missing, place):
    """A single one would hide the overshoot."""
    values = first_order(0.0, 1.0, 0.1)
    values[place] = missing
    with pytest.raises(ValueError, match="1 of 350 values are not finite"):
        step_response(TIME, values, 0.0, 1.0, band=0.1)


def test_noise_is_neither_overshoot_nor_out_of_the_band():
    """Up to the noise before the step; a bump above it counts."""
    noise = np.random.default_rng(1).normal(0.0, 0.05, TIME.size)
    values = first_order(0.0, 1.0, 0.02) + noise
    known = noise_before(TIME, values)
    assert known == pytest.approx(0.05, rel=0.4)
    answer = step_response(TIME, values, 0.0, 1.0, 0.02, known)
    assert answer.overshoot == 0.0
    assert answer.settling_time < 0.1
    bump = np.where((TIME > 0.2) & (TIME < 0.3), 1.0, 0.0)
    assert step_response(TIME, values + bump, 0.0, 1.0, 0.02, known).overshoot > 50.0


def test_without_samples_before_the_step_the_noise_is_0():
    """A slope before the step is no noise either."""
    assert math.isnan(noise_before(TIME[46:], np.zeros(TIME.size - 46)))
    assert noise_before(TIME, 3.0 * TIME) == pytest.approx(0.0, abs=1e-12)


def test_too_few_points_are_refused():
    """Nine points after the step are not judged."""
    with pytest.raises(ValueError, match="9 points"):
        step_response(TIME[:59], np.zeros(59), 0.0, 1.0, band=0.1)


def test_a_step_of_no_height_is_refused():
    """Its characteristics have nothing to refer to."""
    with pytest.raises(ValueError, match="a step from 2 to 2 has no response"):
        step_response(TIME, np.full_like(TIME, 2.0), 2.0, 2.0, band=0.1)


def test_the_spread_is_that_between_repetitions():
    """The spread of shifted copies is the deviation of their shifts; a single copy has none."""
    base = first_order(0.0, 1.0, 0.1)
    assert spread_of([TIME] * 3, [base - 0.1, base, base + 0.1], 0.01) == pytest.approx(0.1)
    assert math.isnan(spread_of([TIME], [base], 0.01))


def test_noise_alone_stays_below_its_greatest_deviation():
    """Few points know their variance badly; without noise nothing is added."""
    for points in (5, 12, 100):
        found = np.random.default_rng(points).normal(0.0, 0.1, (10_000, points)).std(axis=1)
        assert (found > with_noise(0.0, 0.1, points)).mean() < 0.002
    assert with_noise(0.1, 0.0, 12) == pytest.approx(0.1)
    assert with_noise(0.3, 0.4, 10**9) == pytest.approx(0.5, rel=1e-3)
    with pytest.raises(ValueError, match="1 points have no deviation"):
        with_noise(0.1, 0.1, 1)
