"""Pinhole cameras: pixels, depths, planes, and points that two of them see."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot.errors import RefusedError
from rtf.robot.kinematics import Pinhole, pose_of, triangulated

CAMERA = Pinhole(320, 240, 343.12, 343.12, 160.0, 120.0)
AHEAD = np.eye(4)
BESIDE = pose_of((0.07, 0.0, 0.0, 0.0, 1.0, 0.0, -0.1))
POINTS = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(0.2, 3.0)).map(np.array)


def test_the_middle_is_straight_ahead():
    """Right in the picture is along x, down along y."""
    assert CAMERA.pixel_of((0, 0, 2), AHEAD).tolist() == [160, 120]
    assert CAMERA.pixel_of((1, 0.5, 2), AHEAD) == pytest.approx([160 + 343.12 / 2, 120 + 343.12 / 4])
    homogeneous = CAMERA.matrix @ (1, 0.5, 2, 1)
    assert homogeneous[:2] / homogeneous[2] == pytest.approx(CAMERA.pixel_of((1, 0.5, 2), AHEAD))


@given(POINTS)
def test_a_point_is_found_again(point):
    """By its depth, by a plane through it, and by two cameras."""
    pixel = CAMERA.pixel_of(point, BESIDE)
    depth = (BESIDE[:3, :3].T @ (point - BESIDE[:3, 3]))[2]
    assert CAMERA.point_at(pixel, depth, BESIDE) == pytest.approx(point, abs=1e-9)
    assert CAMERA.point_on(pixel, (0, 0, 2, -2 * point[2]), BESIDE) == pytest.approx(point, abs=1e-9)
    seen = [CAMERA.pixel_of(point, pose) for pose in (AHEAD, BESIDE)]
    assert triangulated(seen, [CAMERA, CAMERA], [AHEAD, BESIDE]) == pytest.approx(point, abs=1e-7)


def test_what_is_refused():
    """Points behind, planes that are not met, rays that determine nothing, and what is no pixel."""
    with pytest.raises(RefusedError, match="2 m behind the camera"):
        CAMERA.pixel_of((0, 0, -2), AHEAD)
    with pytest.raises(RefusedError, match="parallel to the plane 0 1 0 -1"):
        CAMERA.point_on((160, 120), (0, 1, 0, -1), AHEAD)
    with pytest.raises(RefusedError, match="behind the camera"):
        CAMERA.point_on((160, 120), (0, 0, 1, 1), AHEAD)
    with pytest.raises(RefusedError, match="they determine no point"):
        triangulated([(160, 120)] * 2, [CAMERA] * 2, [AHEAD] * 2)
    with pytest.raises(RefusedError, match="a pixel has 2 numbers"):
        CAMERA.ray_of((1, 2, 3))
    with pytest.raises(RefusedError, match="a plane has 4 numbers"):
        CAMERA.point_on((1, 2), (0, 0, float("inf"), 1), AHEAD)
