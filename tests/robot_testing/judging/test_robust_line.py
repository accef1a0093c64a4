"""Lines through points with noise and outliers in either coordinate."""

import math

import numpy as np
import pytest

from rtf.robot_testing.judging.robust_line import slopes_between

RANDOM = np.random.default_rng(5)
SWING = 10.0 * np.sin(np.linspace(0.0, 12.0, 900))


@pytest.mark.parametrize("slope", [1.0, -1.5, 0.02])
def test_points_on_a_line_have_one_slope(slope):
    """Both directions agree, and no point is an outlier."""
    found = slopes_between(SWING, slope * SWING + 3.0)
    assert (found.low, found.high) == pytest.approx((slope, slope))
    assert found.outliers == 0.0


@pytest.mark.parametrize("noisy", ["x", "y", "both"])
def test_the_slope_is_between_both_directions(noisy):
    """Noise of a third of the signal, in either coordinate or in both."""
    x = SWING + RANDOM.normal(0.0, 3.0, SWING.size) * (noisy != "y")
    y = SWING + RANDOM.normal(0.0, 3.0, SWING.size) * (noisy != "x")
    found = slopes_between(x, y)
    assert found.low - 0.03 < 1.0 < found.high + 0.03
    assert found.nearest(1.0) == pytest.approx(1.0, abs=0.03)
    assert found.nearest(1.5) < 1.35


@pytest.mark.parametrize("coordinate", [0, 1])
@pytest.mark.parametrize("height", [8.0, 60.0, -500.0])
def test_spikes_do_not_move_the_slope(coordinate, height):
    """Spikes in two of a hundred points, of any height, in either coordinate."""
    points = np.array([SWING, 1.2 * SWING])
    points[coordinate, ::50] += height
    found = slopes_between(*points)
    assert (found.low, found.high) == pytest.approx((1.2, 1.2), abs=1e-3)
    assert found.outliers == pytest.approx(0.02, abs=0.005)


def test_a_value_that_does_not_follow_has_no_slope():
    """Forward it is none, backward it is not bounded."""
    found = slopes_between(SWING, np.zeros(SWING.size))
    assert (found.low, found.high) == (0.0, math.inf)


@pytest.mark.parametrize("x", [[1.0, 2.0], [2.0, 2.0, 2.0]])
def test_points_without_a_line_are_refused(x):
    """Too few, or all at one x."""
    with pytest.raises(ValueError, match="a line needs"):
        slopes_between(x, [1.0, 2.0, 3.0][: len(x)])
