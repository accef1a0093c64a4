"""The sharpness of a picture, beside another one of the same scene."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot_testing.judging.picture_sharpness import picture_sharpness

ROWS, COLUMNS = np.mgrid[:120, :160].astype(float)


def scene(width: float, *, contrast: float = 100.0, noise: float = 0.0) -> np.ndarray:
    """A bright square on a grey ground, whose edges are ``width`` pixels wide."""
    across = np.minimum(40.0 - abs(ROWS - 60.0), 50.0 - abs(COLUMNS - 80.0))
    grey = 60.0 + contrast / (1.0 + np.exp(-np.clip(across / width, -50.0, 50.0)))
    colours = np.stack([grey, 0.7 * grey, 0.9 * grey], axis=2)
    colours += np.random.default_rng(1).normal(0.0, noise, colours.shape)
    return np.clip(np.rint(colours), 0, 255).astype(np.uint8)


def test_wide_edges_are_less_sharp():
    """About with the square root of the width of an edge."""
    sharp, wide = picture_sharpness(scene(1.0)), picture_sharpness(scene(4.0))
    assert wide / sharp == pytest.approx(0.5, abs=0.1)


@given(st.floats(1.0, 4.0), st.floats(60.0, 150.0), st.floats(0.0, 2.0))
def test_exposure_and_some_noise_do_not_matter(width: float, contrast: float, noise: float):
    """As long as edges are higher than the noise, and than the steps of the pixels' whole numbers."""
    found = picture_sharpness(scene(width, contrast=contrast, noise=noise))
    assert math.isnan(found) or found == pytest.approx(picture_sharpness(scene(width)), rel=0.15)


def test_pictures_without_a_sharpness():
    """A picture of one colour has no sharpness; of a noisy one it is not known."""
    assert picture_sharpness(np.full((20, 30, 3), 7, np.uint8)) == 0.0
    assert picture_sharpness(np.zeros((20, 30), np.uint8)) == 0.0
    assert math.isnan(picture_sharpness(scene(3.0, noise=20.0)))
