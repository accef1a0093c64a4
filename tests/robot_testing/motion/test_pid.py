"""The PID controller of tests that close a loop themselves."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot_testing.motion.pid import DiscretePid

PERIOD = 0.01


@given(kp=st.floats(0.1, 10), error=st.floats(-5, 5))
def test_the_proportional_part_is_gain_times_error(kp, error):
    """And nothing else, without the other gains."""
    pid = DiscretePid(kp, 0.0, 0.0, limit=1000.0)
    assert pid.output(error, 0.0, 0.0) == pytest.approx(kp * error)


@given(ki=st.floats(0.1, 10), error=st.floats(0.1, 5))
def test_the_integral_grows_with_time(ki, error):
    """A constant error of one second is worth its gain."""
    pid = DiscretePid(0.0, ki, 0.0, limit=1e9)
    outputs = [pid.output(error, 0.0, PERIOD * step) for step in range(101)]
    assert outputs[-1] == pytest.approx(ki * error, rel=1e-6)


@given(kp=st.floats(1.0, 10), time=st.floats(0.02, 1.0), slope=st.floats(-5, 5))
def test_the_derivative_of_a_ramp_is_its_slope(kp, time, slope):
    """After the filter has settled."""
    kd = kp * time
    pid = DiscretePid(kp, 0.0, kd, limit=1e9)
    steps = 500
    outputs = [pid.output(slope * PERIOD * step, 0.0, PERIOD * step) for step in range(steps)]
    proportional = kp * slope * PERIOD * (steps - 1)
    assert outputs[-1] - proportional == pytest.approx(kd * slope, abs=1e-3 * (1 + abs(kd * slope)))


@pytest.mark.parametrize("kick", [0.0, 0.4, 1.0])
def test_a_step_of_the_setpoint_acts_by_its_share(kick):
    """Besides the proportional part."""
    pid = DiscretePid(2.0, 0.0, 5.0, limit=1e9, kick=kick)
    pid.output(0.0, 0.0, 0.0)
    assert pid.output(1.0, 0.0, PERIOD) - 2.0 == pytest.approx(kick * 2 * 5.0 / (PERIOD + 2 * 0.25))


def test_the_stamps_of_the_values_count():
    """A ramp with irregular samples has the same slope and integral."""
    times = [0.0, 0.01, 0.02, 0.05, 0.06, 0.1, 0.11, 0.12, 0.2, 0.21, 0.3]
    derivative = DiscretePid(1.0, 0.0, 0.2, limit=1e9)
    found = [derivative.output(0.0, 3.0 * time, time) + 3.0 * time for time in times]
    assert found[-1] == pytest.approx(-0.2 * 3.0, rel=1e-2)
    integral = DiscretePid(0.0, 1.0, 0.0, limit=1e9)
    assert [integral.output(2.0, 0.0, time) for time in times] == pytest.approx([2.0 * time for time in times])


def test_repeated_and_overtaken_values_change_nothing():
    """The output stays as it was."""
    pid = DiscretePid(2.0, 1.0, 0.1, limit=100.0)
    pid.output(0.0, 0.0, 0.0)
    after = pid.output(0.0, 1.0, PERIOD)
    assert pid.output(0.0, 1.0, PERIOD) == after
    assert pid.output(0.0, 0.5, 0.0) == after


def test_the_output_is_limited_and_the_integral_does_not_wind_up():
    """After ten seconds at the limit the output leaves it within a few periods."""
    pid = DiscretePid(1.0, 5.0, 0.0, limit=10.0)
    assert max(pid.output(5.0, 0.0, PERIOD * step) for step in range(1000)) == 10.0
    after = [pid.output(-5.0, 0.0, PERIOD * step) for step in range(1000, 1100)]
    assert after[-1] < 0.0
    assert min(after) >= -10.0


def test_it_begins_with_the_holding_output():
    """Started with an output it keeps that without an error; a reset forgets everything."""
    pid = DiscretePid(2.0, 1.0, 0.1, limit=100.0)
    pid.start(12.0)
    assert pid.output(45.0, 45.0, 0.0) == 12.0
    pid.output(45.0, 40.0, PERIOD)
    pid.start(0.0)
    assert pid.output(1.0, 1.0, 0.0) == 0.0
