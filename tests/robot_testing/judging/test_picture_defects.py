"""Edges that stand still, lines that do not fit, and colours."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot_testing.judging.picture_defects import colourfulness, line_ratio, still_edges

LINES, COLUMNS = 60, 80


def scene(right: int, down: int) -> np.ndarray:
    """A scene of coloured rectangles, seen by a camera that was turned by so many pixels."""
    random = np.random.default_rng(3)
    wide = np.full((LINES + 40, COLUMNS + 40, 3), 90, np.uint8)
    for _ in range(25):
        top, left = random.integers(0, LINES + 20), random.integers(0, COLUMNS + 20)
        wide[top : top + random.integers(8, 30), left : left + random.integers(8, 30)] = random.integers(0, 255, 3)
    return wide[20 + down : 20 + down + LINES, 20 + right : 20 + right + COLUMNS]


TURNS = ((0, 0), (7, 0), (-9, 0), (0, 8), (3, -9))


def test_a_scene_has_no_edges_that_stand_still():
    """If the camera turns in both directions; along a single one some stay."""
    found = still_edges([scene(*turn) for turn in TURNS])
    assert (found.of_pixels, found.of_edges, found.where.any()) == (0.0, 0.0, False)
    assert still_edges([scene(turn, 0) for turn in (0, 5)]).of_pixels > 0.0


def test_of_a_frozen_picture_all_edges_stand_still():
    """And of a picture without any there are none."""
    assert still_edges([scene(0, 0)] * 3).of_edges == 100.0
    found = still_edges([np.full((9, 9, 3), 40, np.uint8)] * 3)
    assert (found.of_pixels, found.of_edges, found.where.any()) == (0.0, 0.0, False)


@given(st.integers(0, COLUMNS - 1), st.integers(1, 10))
def test_dead_columns_stand_still(first: int, count: int):
    """Most of the two edges of what is black in all pictures, wherever it is."""
    pictures = [scene(*turn).copy() for turn in TURNS]
    for picture in pictures:
        picture[:, first : first + count] = 0
    edges = (first > 0) + (first + count < COLUMNS)
    found = still_edges(pictures)
    assert found.of_edges < 90.0
    assert {*np.flatnonzero(found.where.any(axis=0))} <= {first - 1, first + count - 1}
    assert found.of_pixels == pytest.approx(100.0 * edges / COLUMNS, rel=0.6)


@given(st.integers(2, 6))
def test_displaced_lines_differ_from_their_neighbours(shift: int):
    """More than from the line after the next one, which is displaced as they are."""
    picture = scene(0, 0).copy()
    assert line_ratio(picture) < 0.9
    picture[1::2] = np.roll(picture[1::2], shift, axis=1)
    assert line_ratio(picture) > 1.2


def test_what_has_no_structure():
    """A picture of one colour has no lines that differ, and a black one no colours."""
    assert math.isnan(line_ratio(np.full((9, 9, 3), 40, np.uint8)))
    assert colourfulness(np.zeros((9, 9, 3), np.uint8)) == 0.0


@given(st.floats(0.2, 1.0))
def test_colours_do_not_depend_on_the_exposure(factor: float):
    """And a grey picture has none."""
    picture = scene(0, 0)
    assert colourfulness((factor * picture).astype(np.uint8)) == pytest.approx(colourfulness(picture), rel=0.05)
    assert colourfulness(np.repeat(picture[:, :, :1], 3, axis=2)) == 0.0
