"""Directions as targets: the axis of a tip points to a point."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.robot.errors import RefusedError
from rtf.robot.kinematics import Chain, ChainTables, InverseKinematics, LookAt
from rtf.robot.kinematics.goals import goal_of

POINTS = st.tuples(st.floats(-2.0, -0.2), st.floats(-1.0, 1.0), st.floats(-0.2, 1.2))


@pytest.fixture(scope="session")
def head(tables: ChainTables) -> Chain:
    """Torso and neck."""
    return tables.chain("head", "2.5")


@given(POINTS, st.tuples(*[st.floats(-15, 15)] * 6))
def test_the_jacobian_is_how_the_error_shrinks(head: Chain, point, posture):
    """Across the axis, for small errors, where it is exact: compared with differences."""
    pose = head.pose(posture)
    distance = float(np.linalg.norm(np.array(point) - pose[:3, 3]))
    goal = goal_of(LookAt(pose[:3, 3] + distance * pose[:3, 2]), 1.0, 1.0)
    steps = np.degrees(np.eye(6) * 1e-5)
    errors = [(goal.error(head.pose(posture - step)) - goal.error(head.pose(posture + step))) / 2e-5 for step in steps]
    found = goal.jacobian(pose, head.jacobian(posture))
    np.testing.assert_allclose(found, np.array(errors).T, atol=1e-4)


@settings(max_examples=25)
@given(POINTS)
def test_a_direction_within_reach_is_met(head: Chain, point):
    """The axis goes through the point, near the rest posture; one out of reach is reported by its angle."""
    solution = InverseKinematics(head).solve(LookAt(point), np.zeros(6), active=[False] * 3 + [True] * 3)
    way = np.array(point) - solution.pose[:3, 3]
    angle = np.degrees(np.arccos(min(1.0, way @ solution.pose[:3, 2] / np.linalg.norm(way))))
    assert solution.orientation_error == pytest.approx(angle, abs=1e-4)
    assert solution.position_error == 0.0
    assert solution.reached == (angle <= 0.1)
    assert head.violations(solution.positions) == []
    assert not solution.positions[:3].any()


def test_a_point_behind_is_out_of_reach(head: Chain):
    """The nearest direction is at a limit, and the angle that is left is reported."""
    solution = InverseKinematics(head).solve(LookAt((1.0, 0.1, 0.3)), np.zeros(6), active=[False] * 3 + [True] * 3)
    assert not solution.reached
    assert solution.problem.startswith("the nearest pose is ")
    assert solution.problem.endswith(" deg from the target")
    with pytest.raises(RefusedError, match="a position is three numbers"):
        InverseKinematics(head).solve(LookAt((1.0, 0.1)), np.zeros(6))
