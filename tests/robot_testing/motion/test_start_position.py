"""Start positions of joints."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot_testing.motion.start_position import starting_point


def part(low, high, home):
    """A part with one joint and the attributes that are needed."""
    return SimpleNamespace(low=np.array([low]), high=np.array([high]), home=np.array([home]))


@given(low=st.floats(-100, 0), width=st.floats(10, 200), share=st.floats(0, 1), room=st.floats(0.1, 4))
def test_there_is_room_within_the_limits(low, width, share, room):
    """In one direction for a step, in both for an oscillation; the joint is moved no farther than needed."""
    joint = part(low, low + width, low + share * width)
    start, sign = starting_point(joint, 0, None, room)
    assert low < start < low + width
    assert low <= start + sign * room <= low + width
    middle, _ = starting_point(joint, 0, None, room, both_sides=True)
    assert low <= middle - room
    assert middle + room <= low + width


def test_a_wanted_start_position_counts_if_it_fits():
    """Otherwise the present position counts."""
    joint = part(-50.0, 50.0, 10.0)
    assert starting_point(joint, 0, None, 5.0) == (10.0, 1.0)
    assert starting_point(joint, 0, -20.0, 5.0) == (-20.0, 1.0)
    assert starting_point(joint, 0, 60.0, 5.0) == pytest.approx((49.0, -1.0))
