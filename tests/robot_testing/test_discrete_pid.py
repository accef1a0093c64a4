"""The controller that tests close loops with."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot_testing.pid import DiscretePid


@given(kp=st.floats(0.1, 10), error=st.floats(-5, 5))
def test_the_proportional_part_is_gain_times_error(kp, error):
    """And nothing else, without the other gains."""
    pid = DiscretePid(kp, 0.0, 0.0, period=0.01, limit=1000.0)
    assert pid.output(error, 0.0) == pytest.approx(kp * error)


@given(ki=st.floats(0.1, 10), error=st.floats(0.1, 5))
def test_the_integral_grows_with_time(ki, error):
    """A constant error for one second is worth its gain, but for the half period in which it begins."""
    pid = DiscretePid(0.0, ki, 0.0, period=0.01, limit=1e9)
    outputs = [pid.output(error, 0.0) for _ in range(100)]
    assert outputs[-1] == pytest.approx(ki * error * 0.995, rel=1e-6)


@given(kp=st.floats(1.0, 10), time=st.floats(0.02, 1.0), slope=st.floats(-5, 5))
def test_the_derivative_of_a_ramp_is_its_slope(kp, time, slope):
    """After the filter has come to rest."""
    kd = kp * time
    pid = DiscretePid(kp, 0.0, kd, period=0.01, limit=1e9)
    steps = 500
    outputs = [pid.output(slope * 0.01 * step, 0.0) for step in range(steps)]
    assert outputs[-1] - kp * slope * 0.01 * (steps - 1) == pytest.approx(kd * slope, abs=1e-3 * (1 + abs(kd * slope)))


def test_the_output_is_limited_and_the_integral_does_not_wind_up():
    """After ten seconds against the limit it comes off it within some periods."""
    pid = DiscretePid(1.0, 5.0, 0.0, period=0.01, limit=10.0)
    assert max(pid.output(5.0, 0.0) for _ in range(1000)) == 10.0
    after = [pid.output(-5.0, 0.0) for _ in range(100)]
    assert after[-1] < 0.0
    assert min(after) >= -10.0


def test_it_begins_with_what_holds():
    """Started with an output, it gives that as long as nothing is wrong; started anew it has forgotten everything."""
    pid = DiscretePid(2.0, 1.0, 0.1, period=0.01, limit=100.0)
    pid.start(12.0)
    assert pid.output(45.0, 45.0) == 12.0
    pid.output(45.0, 40.0)
    pid.start(0.0)
    assert pid.output(1.0, 1.0) == 0.0
