"""The shift of a picture's content, for pictures whose shift is known."""

from __future__ import annotations

import numpy as np
import pytest

from rtf.robot_testing.judging.picture_shift import shift_between

RANDOM = np.random.default_rng(3)
#: A scene with structures of some pixels, larger than a picture.
SCENE = sum(
    np.kron(RANDOM.integers(0, 60, (400 // size, 500 // size)), np.ones((size, size))) for size in (4, 10, 20)
).astype(np.uint8)


def picture(right: int, down: int) -> np.ndarray:
    """What a camera sees whose picture has moved by this."""
    return SCENE[60 - down : 60 - down + 240, 60 - right : 60 - right + 320]


@pytest.mark.parametrize("shift", [(0, 0), (20, 0), (-20, 5), (3, -31), (40, 40)])
def test_a_known_shift_is_found(shift: tuple[int, int]):
    """To both sides, in both directions, to a tenth of a pixel."""
    found = shift_between(picture(0, 0), picture(*shift))
    assert (found.right, found.down) == pytest.approx(shift, abs=0.15)
    assert found.peak > 0.1


def test_colours_and_noise_do_not_matter():
    """A picture with three colours and the noise of a sensor."""
    before, after = (np.repeat(picture(*where)[:, :, None], 3, axis=2) for where in ((0, 0), (12, -7)))
    noisy = np.clip(after + RANDOM.normal(0.0, 4.0, after.shape), 0, 255).astype(np.uint8)
    found = shift_between(before, noisy)
    assert (found.right, found.down) == pytest.approx((12.0, -7.0), abs=0.2)


def test_pictures_without_anything_in_common_have_no_peak():
    """As of another scene, or of a wall."""
    other = RANDOM.integers(0, 255, (240, 320)).astype(np.uint8)
    assert shift_between(picture(0, 0), other).peak < 0.03
    assert shift_between(np.full((24, 32), 7, np.uint8), np.full((24, 32), 7, np.uint8)).peak == 0.0
