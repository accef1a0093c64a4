"""What friction explains of the motion of a joint."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot.interfaces import Pid
from rtf.robot_testing.judging.friction_hold import friction_reach, held_by_friction
from rtf.robot_testing.judging.sine import fit_sine

TIME = np.arange(0.0, 4.0, 0.01)
SINE = 3.0 * np.sin(np.pi * TIME)


def pid(kp: float, ki: float = 0.0) -> Pid:
    """A controller with an output of 100 %."""
    return Pid(kp=kp, ki=ki, max_integral=100.0, max_output=100.0)


def test_a_joint_stands_where_it_turns():
    """Until the error is the reach, on both sides; then it follows, so far behind."""
    held = held_by_friction(TIME, SINE, pid(5.0), 5.0)
    assert friction_reach(pid(5.0), 5.0) == 1.0
    assert np.abs(held - SINE).max() == pytest.approx(1.0)
    assert held.max() == pytest.approx(2.0, abs=0.001)
    assert np.count_nonzero(np.diff(held) == 0) > 100


def test_the_integral_has_to_turn_as_well():
    """It has grown against the friction, and helps it where the joint turns: a finger of a simulated robot."""
    alone, both = (held_by_friction(TIME, SINE, pid(4.17, ki), 3.7) for ki in (0.0, 14.8))
    assert np.abs(both - SINE)[200:].max() > np.abs(alone - SINE)[200:].max() + 0.2
    whole = slice(200, None)
    assert fit_sine(TIME[whole], both[whole], 0.5).rms == pytest.approx(0.219, abs=0.01)


@given(kp=st.floats(0.5, 100.0), ki=st.floats(0.0, 300.0), friction=st.floats(0.0, 10.0))
def test_more_friction_never_helps(kp: float, ki: float, friction: float):
    """Without any the joint is where it should be. Without an integral, which may overshoot, more of it is worse."""
    assert held_by_friction(TIME, SINE, pid(kp, ki), 0.0) == pytest.approx(SINE)
    some, more = (held_by_friction(TIME, SINE, pid(kp), one) for one in (friction, 2 * friction))
    assert np.abs(some - SINE).max() <= np.abs(more - SINE).max() + 1e-9


def test_a_controller_without_a_proportional_part_stands():
    """Its reach has no end."""
    assert friction_reach(pid(0.0), 1.0) == float("inf")
    assert (held_by_friction(TIME, SINE, pid(0.0), 1.0) == 0.0).all()
