"""The noise of a picture, from one picture alone."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot_testing.judging.picture_noise import picture_noise

ROWS, COLUMNS = np.mgrid[:120, :160].astype(float)


@given(st.floats(1.0, 30.0), st.integers(0, 2**32 - 1))
def test_noise_is_found_on_slopes_and_edges(deviation: float, seed: int):
    """A slope, and a bright square with straight edges, are no noise."""
    scene = 80.0 + 0.3 * ROWS + 0.2 * COLUMNS + 40.0 * ((abs(ROWS - 60) < 20) & (abs(COLUMNS - 80) < 30))
    noisy = scene[..., None] + np.random.default_rng(seed).normal(0.0, [deviation, deviation / 4, 0.0], (120, 160, 3))
    assert picture_noise(np.clip(np.rint(noisy), 0, 255).astype(np.uint8)) == pytest.approx(deviation, rel=0.15)


def test_pictures_without_noise_have_none():
    """Of one colour, or with the steps of whole numbers on a slope; grey ones, too."""
    assert picture_noise(np.full((120, 160, 3), 77, np.uint8)) == 0.0
    assert picture_noise((ROWS + COLUMNS).clip(0, 255).astype(np.uint8)) == 0.0
    assert picture_noise(np.rint(100 + 0.37 * ROWS + 0.21 * COLUMNS).astype(np.uint8)) < 1.0
