"""A red ball in a picture: pictures are drawn ray by ray, so its place is known exactly."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from rtf.red_ball.detection import find_ball
from rtf.red_ball.eyes import pinhole
from rtf.red_ball.regions import regions

CAMERA = pinhole(320, 240, 42.0)
RADIUS = 0.035


def picture(*balls, background=(120, 120, 130)) -> np.ndarray:
    """A picture of red balls (x, y, z, radius) in the frame of the camera; later ones are in front."""
    columns, rows = np.meshgrid(np.arange(CAMERA.width) + 0.5, np.arange(CAMERA.height) + 0.5)
    rays = np.dstack([(columns - CAMERA.cx) / CAMERA.fx, (rows - CAMERA.cy) / CAMERA.fy, np.ones_like(rows)])
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    drawn = np.full((CAMERA.height, CAMERA.width, 3), background, dtype=np.uint8)
    for *centre, radius in balls:
        away = float(np.linalg.norm(centre))
        drawn[rays @ (np.array(centre) / away) > np.sqrt(1.0 - (radius / away) ** 2)] = (200, 20, 20)
    return drawn


PLACES = st.tuples(st.floats(-0.1, 0.1), st.floats(-0.05, 0.05), st.floats(0.3, 0.7))


class TestFindBall:
    """Its place by one picture."""

    @settings(max_examples=60, deadline=None)
    @given(PLACES)
    def test_place_by_direction_and_size(self, place):
        """Within 2 % of the distance, and a fifth of a pixel across, also where its picture is no circle."""
        seen = find_ball(picture((*place, RADIUS)), CAMERA, RADIUS)
        assert seen is not None
        np.testing.assert_allclose(seen.pixel, CAMERA.pixel_of(place, np.eye(4)), atol=0.2)
        assert np.linalg.norm(seen.place - place) < 0.02 * np.linalg.norm(place)
        assert seen.likelihood > 0.9

    def test_half_of_it_is_enough(self):
        """The other half is behind something, or beyond the edge."""
        place = np.array([0.0, 0.0, 0.4])
        whole = picture((*place, RADIUS))
        half = whole.copy()
        half[:, :160] = (200, 200, 200)
        seen = find_ball(half, CAMERA, RADIUS)
        assert seen is not None
        assert np.linalg.norm(seen.place - place) < 0.01
        assert 0.4 < seen.likelihood < 0.7
        edge = CAMERA.point_at((320, 120), 0.4, np.eye(4))
        seen = find_ball(picture((*edge, RADIUS)), CAMERA, RADIUS)
        assert seen is not None
        assert np.linalg.norm(seen.place - edge) < 0.02

    def test_other_red_things_are_no_ball(self):
        """A red arm, with straight sides; and the ball beside it is found."""
        drawn = picture()
        drawn[100:220, 20:90] = (150, 30, 30)
        assert find_ball(drawn, CAMERA, RADIUS) is None
        both = picture((0.05, 0.0, 0.4, RADIUS))
        both[100:220, 20:90] = (150, 30, 30)
        seen = find_ball(both, CAMERA, RADIUS)
        assert seen is not None
        assert np.linalg.norm(seen.place - [0.05, 0.0, 0.4]) < 0.01

    @pytest.mark.parametrize("colour", [(0, 0, 0), (255, 255, 255), (200, 20, 20), (120, 120, 130)])
    def test_a_picture_of_one_colour_has_none(self, colour):
        """Not even a red one."""
        assert find_ball(picture(background=colour), CAMERA, RADIUS) is None

    def test_a_ball_of_a_few_pixels_has_no_distance(self):
        """It is not reported."""
        assert find_ball(picture((0.0, 0.0, 5.0, RADIUS)), CAMERA, RADIUS) is None

    def test_noise_is_no_ball_and_takes_no_time(self):
        """Every other pixel is red: many small regions."""
        noise = np.random.default_rng(1).integers(0, 256, (240, 320, 3)).astype(np.uint8)
        assert find_ball(noise, CAMERA, RADIUS) is None


class TestRegions:
    """Pixels that hang together."""

    @settings(max_examples=200, deadline=None)
    @given(arrays(bool, st.tuples(st.integers(1, 12), st.integers(1, 12))))
    def test_they_are_those_of_a_flood(self, mask):
        """Each pixel of the mask is in one region, with all that can be reached from it."""
        expected = []
        left = {tuple(place) for place in np.argwhere(mask)}
        while left:
            flood, edge = set(), [left.pop()]
            while edge:
                row, column = edge.pop()
                flood.add((row, column))
                for near in ((row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)):
                    if near in left:
                        left.remove(near)
                        edge.append(near)
            expected.append(frozenset(flood))
        found = regions(mask, 1)
        assert {frozenset(map(tuple, np.argwhere(region))) for region in found} == set(expected)
        sizes = [int(region.sum()) for region in found]
        assert sizes == sorted(sizes, reverse=True)

    def test_small_ones_are_left_out(self):
        """Below the given number of pixels."""
        mask = np.zeros((5, 5), dtype=bool)
        mask[0, 0] = mask[2, 1:4] = True
        assert [int(region.sum()) for region in regions(mask, 2)] == [3]
