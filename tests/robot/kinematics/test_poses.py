"""Poses as vectors and matrices, and back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot.errors import RefusedError
from rtf.robot.kinematics import axis_angle_of, pose_error, pose_of, rotation_of, vector_of
from rtf.robot.kinematics.poses import checked_pose

AXES = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda axis: np.linalg.norm(axis) > 1e-3)


@given(AXES, st.floats(1e-6, math.pi - 1e-6))
def test_axis_and_angle_come_back(axis, angle):
    """A rotation between none and half a turn has the axis and the angle that it was made of."""
    found = axis_angle_of(rotation_of(axis, angle))
    np.testing.assert_allclose(found[:3] * found[3], np.array(axis) / np.linalg.norm(axis) * angle, atol=1e-9)


@given(AXES)
def test_half_a_turn(axis):
    """The axis of half a turn comes back up to its sign."""
    found = axis_angle_of(rotation_of(axis, math.pi))
    assert abs(found[:3] @ axis) == pytest.approx(np.linalg.norm(axis), abs=1e-7)
    assert found[3] == pytest.approx(math.pi, abs=1e-7)


def test_no_rotation():
    """The axis of no rotation is z, as on the wire; any axis with the angle 0 is no rotation."""
    assert axis_angle_of(np.eye(3)).tolist() == [0.0, 0.0, 1.0, 0.0]
    assert pose_of([1, 2, 3, 0, 0, 0, 0])[:3, :3].tolist() == np.eye(3).tolist()
    assert vector_of(pose_of([1, 2, 3, 5, 0, 0, 0])).tolist() == [1, 2, 3, 0, 0, 1, 0]


def test_what_is_left():
    """The error leads from the pose to the wanted one, in the axes of the root."""
    wanted, pose = pose_of([1, 0, 0, 0, 0, 1, 0.3]), pose_of([0, 0, 0, 0, 0, 1, 0.1])
    np.testing.assert_allclose(pose_error(wanted, pose), [1, 0, 0, 0, 0, 0.2], atol=1e-12)


@pytest.mark.parametrize(
    "vector", [[0] * 6, [0, 0, math.nan, 0, 0, 1, 0], [0, 0, 0, 0, 0, 0, 1], [0, 0, 0, 1, 0, 0, math.inf]]
)
def test_what_is_no_pose(vector):
    """Other counts, no numbers, and an axis of no length are refused."""
    with pytest.raises(RefusedError):
        pose_of(vector)


def test_matrices():
    """A rounded rotation is made exact; a mirror, a scaled matrix and one with another last row are refused."""
    rounded = pose_of([0.1, 0.2, 0.3, 1, 2, 3, 1.0]).round(6)
    exact = checked_pose(rounded)
    np.testing.assert_allclose(exact[:3, :3] @ exact[:3, :3].T, np.eye(3), atol=1e-15)
    for matrix in (np.diag([1.0, 1.0, -1.0, 1.0]), 1.1 * np.eye(4), np.ones((4, 4)), np.diag([1.0, 1.0, 1.0, 2.0])):
        with pytest.raises(RefusedError):
            checked_pose(matrix)
