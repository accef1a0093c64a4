"""What the channels of a sensor show of a known vector: axes, signs and gains."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot_testing.judging.vector_channels import channels_of

ERROR = 0.1
RANDOM = np.random.default_rng(5)
#: Nine postures: the directions of 20 N.
LOADS = np.array([vector / np.linalg.norm(vector) for vector in RANDOM.normal(size=(9, 3))]) * 20.0
NOISE = RANDOM.normal(scale=0.02, size=(9, 3))


def test_a_healthy_sensor_shows_each_axis_with_a_gain_of_one():
    """An offset changes nothing."""
    channels = channels_of(LOADS + NOISE + [3.0, -7.0, 50.0], LOADS, ERROR)
    assert [(one.axis, one.sign) for one in channels] == [(0, 1), (1, 1), (2, 1)]
    assert [one.line.slope for one in channels] == pytest.approx([1.0] * 3, abs=0.005)


@given(st.permutations([0, 1, 2]), st.tuples(*[st.sampled_from([-1, 1])] * 3), st.floats(0.3, 3.0))
def test_axes_and_signs_are_recognised(order: list[int], signs: tuple[int, ...], gain: float):
    """Whatever is exchanged or reversed, at any gain."""
    channels = channels_of(gain * LOADS[:, order] * signs + NOISE, LOADS, ERROR)
    assert [(one.axis, one.sign) for one in channels] == list(zip(order, signs, strict=True))


def test_an_axis_without_a_load_is_known_by_its_spread():
    """It is healthy as far as one can see, and another axis does not explain its noise."""
    loads = LOADS * [1.0, 1.0, 0.001]
    channels = channels_of(loads + NOISE, loads, ERROR)
    assert channels[2].axis == 2
    assert channels[2].spread < ERROR
    exchanged = channels_of((loads + NOISE)[:, [0, 2, 1]], loads, ERROR)
    assert exchanged[2].axis == 1, "it shows a load that it cannot have"
