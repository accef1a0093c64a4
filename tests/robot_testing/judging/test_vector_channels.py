"""What the channels of a sensor show of a known vector: axes, signs and gains."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot_testing.judging.vector_channels import Bounds, channels_of, cross_talk, judge_channels

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


class Judged:
    """Keeps what a test would have judged: the names of the values out of bounds."""

    def __init__(self) -> None:
        self.wrong: list[str] = []
        self.reports: list[str] = []

    def measure(self, name, value, unit="", low=None, high=None, hint=""):
        """Keep the name of a value out of bounds."""
        if (low is not None and value < low) or (high is not None and value > high):
            self.wrong.append(name)

    def check_fail_if_false(self, condition, text):
        """Keep the failure."""
        if not condition:
            self.wrong.append(text.partition("; ")[0])
        return condition

    def report(self, text):
        """Keep the report."""
        self.reports.append(text)


def judged(measured: np.ndarray, loads: np.ndarray = LOADS) -> Judged:
    """What is wrong with a sensor of forces."""
    found = Judged()
    judge_channels(found, "left", "force", "N", measured, loads, Bounds(gain=0.1, error=ERROR, known=5.0))
    return found


def test_gains_beyond_the_tolerance_fail_and_an_offset_does_not():
    """Each channel by itself."""
    assert judged(LOADS + NOISE + 30.0).wrong == []
    assert judged(LOADS * [1.0, 0.85, 1.0] + NOISE).wrong == ["gain of force y"]


def test_a_turned_sensor_has_changes_without_a_reason():
    """By 15 degrees about z: the gains of x and y are hardly wrong."""
    c, s = np.cos(np.radians(15.0)), np.sin(np.radians(15.0))
    turned = LOADS @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    assert {"unexplained of force x", "unexplained of force y"} <= set(judged(turned + NOISE).wrong)
    assert "unexplained of force z" not in judged(turned + NOISE).wrong


def test_what_cannot_be_known_is_reported():
    """The gain of an axis along which nothing changes; exchanged axes are named."""
    loads = LOADS * [1.0, 1.0, 0.001]
    found = judged(loads + NOISE, loads)
    assert found.wrong == []
    assert found.reports[0].startswith("force z should change by")
    assert judged(LOADS[:, [1, 0, 2]] + NOISE).wrong[:2] == [
        "left: its force x shows what is along y",
        "left: its force y shows what is along x",
    ]


@given(st.integers(0, 2), st.integers(1, 2), st.sampled_from([-0.3, 0.2, 0.5]))
def test_cross_talk_is_named(own: int, step: int, share: float):
    """A channel that shows a share of another axis, which its own line does not explain."""
    other, measured = (own + step) % 3, LOADS + NOISE
    measured[:, own] += share * LOADS[:, other]
    wrong = judged(measured).wrong
    assert f"{'xyz'[other]} in force {'xyz'[own]}" in wrong
    assert all(name.endswith(f"force {'xyz'[own]}") for name in wrong)


def test_axes_that_vary_together_have_no_cross_talk():
    """A load whose y is always twice its x: what a channel shows of which cannot be known."""
    loads = LOADS[:, [0, 0, 2]] * [1.0, 2.0, 1.0] + 0.001 * NOISE
    assert judged(loads + NOISE, loads).wrong == []


def test_more_cross_talk_than_its_interval_is_named():
    """Of axes that vary nearly together a large share is known for certain, and a small one is not judged."""
    loads = LOADS.copy()
    loads[:, 2] = loads[:, 0] + 0.015 * loads[:, 2]
    measured = loads + NOISE
    _, interval = cross_talk(measured[:, 0], loads, [0, 1, 2])[2]
    assert 0.1 < interval < 0.2
    assert judged(measured, loads).wrong == []
    measured[:, 0] += 0.4 * loads[:, 2]
    assert "z in force x" in judged(measured, loads).wrong
