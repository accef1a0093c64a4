"""The motion of a tip: delay, profile of the speed, detour, and margins to limits, of known motions."""

from __future__ import annotations

from io import BytesIO

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from rtf.robot_testing.judging.path_picture import path_picture
from rtf.robot_testing.judging.tip_motion import TipMotion

TIME = np.linspace(0.0, 1.0, 101)


def share(time: np.ndarray) -> np.ndarray:
    """The way of a minimum jerk in a second, from 0 to 1."""
    time = np.clip(time, 0.0, 1.0)
    return 10 * time**3 - 15 * time**4 + 6 * time**5


def motion(delay: float = 0.0, *, bow: float = 0.0, way: float = 0.3) -> TipMotion:
    """A motion along x with a bow along z, reported with a delay; its joint goes from 10 to 50 deg."""
    seen = np.column_stack([way * share(TIME), 0 * TIME, bow * np.sin(np.pi * share(TIME))])
    late = share(TIME - delay)
    reported = np.column_stack([way * late, 0 * TIME, bow * np.sin(np.pi * late)])
    return TipMotion(TIME, reported, seen, 10.0 + 40.0 * share(TIME)[:, np.newaxis])


@given(st.floats(0.0, 0.1))
def test_the_delay_is_that_of_the_reported_positions(delay: float):
    """Of any small delay, to a tenth."""
    assert motion(delay).lag == pytest.approx(delay, rel=0.1, abs=1e-6)


def test_a_minimum_jerk_has_its_peak():
    """1.875 times the mean; a little less, as the slow ends do not count."""
    assert motion().peak_ratio == pytest.approx(1.875, rel=0.1)
    assert motion().speeds.max() == pytest.approx(0.3 * 1.875, rel=0.01)


def test_a_stop_on_the_way_raises_the_peak():
    """The same way in half the time, after standing for the other half."""
    one = motion()
    ways = np.where(TIME < 0.4, 0.01 * TIME, 0.004 + 0.296 * share((TIME - 0.6) / 0.2))
    stopped = one._replace(seen=np.column_stack([ways, 0 * TIME, 0 * TIME]))
    assert stopped.peak_ratio > 1.5 * one.peak_ratio or stopped.speeds.max() > 4 * one.speeds.max()


@given(st.floats(0.0, 0.1))
def test_the_detour_is_that_of_the_bow(bow: float):
    """Its height."""
    assert motion(bow=bow).detour == pytest.approx(bow, abs=1e-3)


def test_margins_are_to_the_nearer_limit():
    """Negative beyond it."""
    low, high = np.array([5.0]), np.array([49.0])
    assert motion().margins(low, high) == pytest.approx([-1.0])
    assert motion().margins(low, np.array([100.0])) == pytest.approx([5.0])


def test_without_a_motion_there_is_no_profile():
    """Nor a delay; the path is no detour."""
    still = motion(way=0.0)
    assert np.isnan(still.lag)
    assert np.isnan(still.peak_ratio)
    assert still.detour == 0.0


def test_the_picture_has_three_planes():
    """With lines in the colours of the paths, and a cross at the target."""
    # Both have a length in all planes, and none is over the other.
    one = motion(bow=0.05).seen + np.outer(share(TIME), [0.0, 0.05, 0.0])
    other = motion().reported - np.outer(share(TIME), [0.0, 0.05, 0.03])
    data = path_picture({"one": one, "other": other}, np.array([0.3, 0.0, 0.0]))
    picture = np.asarray(Image.open(BytesIO(data)))
    assert picture.shape == (300, 900, 3)
    for left in (0, 300, 600):
        colours = {tuple(pixel) for pixel in picture[:, left : left + 300].reshape(-1, 3).tolist()}
        assert {(31, 119, 180), (255, 127, 14), (214, 39, 40)} <= colours
