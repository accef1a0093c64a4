"""Statistics and their confidence, for known numbers."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot_testing.judging.statistics import confidence, fit_line, jitter, line_end, periods_of, student

_RUNS = 1000


@pytest.mark.parametrize(
    ("level", "freedom", "table"),
    [
        (0.99, 1, 63.657),
        (0.99, 2, 9.925),
        (0.99, 3, 5.841),
        (0.99, 4, 4.604),
        (0.99, 9, 3.250),
        (0.99, 1000, 2.581),
        (0.95, 1, 12.706),
        (0.95, 5, 2.571),
    ],
)
def test_intervals_of_a_few_values_are_as_wide_as_the_tables_say(level, freedom, table):
    """Student's distribution, to 1 %."""
    assert student(level, freedom) == pytest.approx(table, rel=0.01)


@pytest.mark.parametrize("count", [3, 6, 11])
def test_the_true_slope_is_within_its_interval(count):
    """In 99 of a hundred series, however short they are."""
    random = np.random.default_rng(count)
    lines = [fit_line(np.arange(count), random.normal(size=count)) for _ in range(_RUNS)]
    assert np.mean([abs(line.slope) <= line.slope_interval for line in lines]) > 0.98


@pytest.mark.parametrize("count", [2, 3, 6])
def test_the_true_mean_is_within_its_interval(count):
    """In 99 of a hundred series; a single value has no interval."""
    random = np.random.default_rng(count)
    means = [confidence(random.normal(size=count)) for _ in range(_RUNS)]
    assert np.mean([abs(mean) <= interval for mean, interval in means]) > 0.98
    assert confidence([1.0]) == (1.0, math.inf)


@pytest.mark.parametrize("missing", [math.nan, math.inf])
def test_a_fit_of_values_that_are_not_finite_is_refused(missing):
    """Its slope would be NaN, and pass for a slope of 0."""
    with pytest.raises(ValueError, match="1 of 4 points are not finite"):
        fit_line(range(4), [0.0, 1.0, missing, 3.0])


def test_the_rate_of_a_steady_stream_has_a_narrow_interval():
    """A late message makes one period longer and the next one shorter: 2 ms are 0.4 Hz of 100 Hz, not 5."""
    random = np.random.default_rng(7)
    found = [periods_of(0.01 * np.arange(201) + random.normal(0.0, 0.002, 201)) for _ in range(_RUNS)]
    assert np.median([one.rate_interval for one in found]) == pytest.approx(0.37, abs=0.05)
    assert np.mean([abs(one.rate - 100.0) <= one.rate_interval for one in found]) > 0.98


@given(st.floats(0.001, 1.0), st.integers(0, 2**32 - 1))
def test_jitter_is_noise_without_what_changes_slowly(deviation: float, seed: int):
    """Neither a sine nor single jumps count; without values there is none."""
    time = np.linspace(0.0, 6.0, 600)
    values = deviation * np.random.default_rng(seed).standard_normal(time.size)
    assert jitter(values + 3.0 * deviation * np.sin(time)) == pytest.approx(deviation, rel=0.25)
    values[::60] += 100.0 * deviation
    assert jitter(values) == pytest.approx(deviation, rel=0.25)
    assert jitter(np.array([1.0])) == 0.0


@given(st.integers(1, 30), st.floats(-5.0, 5.0), st.floats(-100.0, 100.0))
def test_a_line_ends_at_its_last_value(count: int, slope: float, offset: float):
    """Each column for itself; one with NaN has no end."""
    line = offset + slope * np.arange(count)
    broken = np.where(np.arange(count) == count // 2, math.nan, line)
    end = line_end(np.column_stack([line, -line, broken]))
    assert end[:2] == pytest.approx([line[-1], -line[-1]], abs=1e-9 + 1e-9 * abs(offset))
    assert math.isnan(end[2])


def test_the_end_of_a_line_is_known_while_it_is_shaken():
    """Readings of 0.2 s at 100 Hz, of a joint that goes at 3 deg/s and is shaken by 1 deg at 27 Hz, in any phase."""
    time = np.arange(-0.19, 0.001, 0.01)
    ends = [
        float(line_end((3.0 * time + np.sin(2 * math.pi * 27.0 * time + phase))[:, None])[0])
        for phase in np.linspace(0.0, 2 * math.pi, 12)
    ]
    assert np.abs(ends).max() < 0.3
