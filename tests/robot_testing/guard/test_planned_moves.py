"""Planned moves: what would bring two links together is refused before anything is sent."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest

from icub import ICUB
from rtf.robot.interfaces import FloatArray
from rtf.robot.model.workspace import HalfSpace, Workspace
from rtf.robot_testing.guard.planned_moves import MoveCheck, RefusedMoveError

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)
SHOULDER = ICUB.parts["left_arm"].axes
#: The left arm beside the body, with the elbow bent.
BESIDE = np.array([-5.0, 45.0, 60.0, 90.0, *(axis.home for axis in SHOULDER[4:])])


@pytest.fixture(scope="module")
def arm() -> FloatArray:
    """The positions of the arm, which a test may change."""
    return BESIDE.copy()


@pytest.fixture(scope="module")
def moves(arm: FloatArray) -> MoveCheck:
    """The check of moves of a robot whose left arm is there."""
    return MoveCheck(ICUB, {"left_arm": lambda: arm})


def test_an_arm_that_would_hit_the_hip_is_refused(moves: MoveCheck):
    """The message has the part, the joint, the two links and the place."""
    with pytest.raises(
        RefusedMoveError,
        match=r"left_arm: the move of l_shoulder_roll is refused: by the model of icub l_\w+ would touch \w+, "
        r"with l_shoulder_roll at \d+\.\d deg",
    ):
        moves.check("left_arm", [1], np.array([0.0]), np.array([20.0]))


def test_what_happens_on_the_way_counts(moves: MoveCheck):
    """The forearm turns away before the arm has come to the hip, or after that: the speeds decide."""
    joints, both = [1, 2], np.array([0.0, 0.0])
    moves.check("left_arm", joints, both, np.array([5.0, 60.0]))
    with pytest.raises(RefusedMoveError):
        moves.check("left_arm", joints, both, np.array([60.0, 5.0]))


def test_free_moves_are_let_through(moves: MoveCheck):
    """Away from the body, and none at all."""
    moves.check("left_arm", [1, 3], np.array([90.0, 20.0]), np.array([20.0, 20.0]))
    moves.check("left_arm", [1], np.array([45.0]), np.array([20.0]))


def test_what_touches_already_is_not_the_fault_of_the_move(moves: MoveCheck, arm: FloatArray):
    """The arm may leave the hip."""
    arm[1] = 0.0
    try:
        moves.check("left_arm", [1], np.array([60.0]), np.array([20.0]))
    finally:
        arm[:] = BESIDE


def test_motion_is_checked_ahead(moves: MoveCheck, arm: FloatArray):
    """At 60 deg/s for the next 6 deg; a joint at rest, or one that goes away, is not."""
    arm[1] = 8.0
    speeds = np.zeros(len(arm))
    try:
        assert moves.ahead("left_arm", speeds) == ""
        speeds[1] = 60.0
        assert moves.ahead("left_arm", speeds) == ""
        speeds[1] = -60.0
        assert "would touch" in moves.ahead("left_arm", speeds)
    finally:
        arm[:] = BESIDE


def test_a_move_out_of_the_workspace_is_refused(arm: FloatArray):
    """The message has the point, how far it is beyond, and the plane."""
    wall = Workspace((HalfSpace("wall", (0.0, -1.0, 0.0), 0.3),))
    walled = MoveCheck(replace(ICUB, workspace=wall), {"left_arm": lambda: arm})
    with pytest.raises(RefusedMoveError, match=r"l_\w+ is \d+ mm beyond wall of the workspace"):
        walled.check("left_arm", [1, 3], np.array([100.0, 15.0]), np.array([20.0, 20.0]))
