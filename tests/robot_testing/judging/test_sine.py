"""The commanded sine of joints, and the sine that is fitted to their motion."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot_testing.judging.sine import RampedSine, fit_sine

frequencies = st.floats(0.1, 5.0)


@given(frequency=frequencies, cycles=st.integers(1, 6), amplitude=st.floats(0.1, 20))
def test_it_begins_and_ends_at_rest_and_is_a_sine_between(frequency, cycles, amplitude):
    """Position and speed are 0 at both ends; the plateau has the full amplitude; the speed limit holds."""
    sine = RampedSine(np.array([amplitude]), frequency, cycles)
    time = np.linspace(0.0, sine.duration, 4000)
    wave = sine.at(time)[:, 0]
    speed = np.gradient(wave, time)
    assert abs(wave[0]) < 1e-9 * amplitude
    assert abs(wave[-1]) < 1e-6 * amplitude
    assert abs(speed[0]) < 0.01 * sine.greatest_speed[0]
    assert abs(speed[-1]) < 0.01 * sine.greatest_speed[0]
    assert np.abs(speed).max() <= sine.greatest_speed[0]
    first, last = sine.plateau
    whole = (time >= first) & (time <= last)
    fit = fit_sine(time[whole], wave[whole], frequency)
    assert fit.amplitude == pytest.approx(amplitude, rel=1e-3)
    assert fit.rms < 1e-3 * amplitude


@given(frequency=frequencies, amplitude=st.floats(0.1, 10), phase=st.floats(-3.0, 3.0), mean=st.floats(-90, 90))
def test_a_sine_is_found_again(frequency, amplitude, phase, mean):
    """The fit has the same amplitude, phase and mean, without a residual."""
    time = np.linspace(0.0, 3.0 / frequency, 500)
    fit = fit_sine(time, mean + amplitude * np.sin(2 * np.pi * frequency * time - phase), frequency)
    assert fit.amplitude == pytest.approx(amplitude, rel=1e-6)
    assert fit.phase == pytest.approx(phase, abs=1e-6)
    assert fit.mean == pytest.approx(mean, abs=1e-6)
    assert fit.rms < 1e-6


def test_a_ramp_is_no_sine():
    """More than half of a ramp is left as residual."""
    time = np.linspace(0.0, 2.0, 400)
    fit = fit_sine(time, 2 * np.pi * 0.5 * 3.0 * time, 0.5)
    assert fit.rms > 1.5


def test_several_joints_have_their_own_amplitudes():
    """One column for each joint; a single time gives one value each."""
    sine = RampedSine(np.array([1.0, 3.0]), 1.0, 1.0)
    assert sine.at(1.25) == pytest.approx([1.0, 3.0])
    assert sine.at([0.0, 1.25]).shape == (2, 2)


def test_too_few_points_are_refused():
    """Three unknowns need more than three points."""
    with pytest.raises(ValueError, match="4 points"):
        fit_sine([0, 1, 2], [0, 1, 0], 1.0)


def test_harmonics_take_what_repeats_with_the_sine():
    """What is left is the noise; amplitude and phase are those of the sine itself."""
    time = np.arange(0.0, 4.0, 0.01)
    noise = 0.05 * np.random.default_rng(1).standard_normal(time.size)
    wave = 2.0 * np.sin(2 * np.pi * 0.5 * time - 0.3)
    flat = np.clip(wave, -1.8, 1.8)  # stands still where it turns
    alone, whole = (fit_sine(time, flat + noise, 0.5, harmonics=count) for count in (1, 15))
    assert alone.rms > 0.07
    assert whole.rms == pytest.approx(fit_sine(time, noise, 0.5, harmonics=15).rms, rel=0.05)
    assert whole.amplitude == pytest.approx(alone.amplitude, rel=0.01)
    assert whole.phase == pytest.approx(0.3, abs=0.01)
    with pytest.raises(ValueError, match="32 points or more"):
        fit_sine(time[:31], wave[:31], 0.5, harmonics=15)
