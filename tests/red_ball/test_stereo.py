"""A ball in two pictures: where it is, whether the eyes agree, and which one is wrong."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from rtf.red_ball.detection import SeenBall
from rtf.red_ball.eye_check import Look, frozen, swapped
from rtf.red_ball.eyes import pinhole
from rtf.red_ball.stereo import locate
from rtf.robot.kinematics.poses import homogeneous, rotation_of

CAMERA = pinhole(320, 240, 42.0)
#: The right camera: 68 mm to the right, turned inwards by 10 deg.
ACROSS = homogeneous(rotation_of((0.0, 1.0, 0.0), np.radians(-10.0)), (0.068, 0.0, 0.0))
PLACES = st.tuples(st.floats(-0.03, 0.1), st.floats(-0.1, 0.1), st.floats(0.25, 0.6)).map(np.array)


def seen(place, pose=None) -> SeenBall:
    """What a camera without errors sees of a ball in the frame of the left one."""
    pose = np.eye(4) if pose is None else pose
    own = (np.linalg.inv(pose) @ [*place, 1.0])[:3]
    return SeenBall(own, CAMERA.pixel_of(place, pose), 1.0)


def look(place) -> Look:
    """What both see."""
    return Look(seen(place), seen(place, ACROSS))


@settings(max_examples=100, deadline=None)
@given(PLACES)
def test_the_rays_meet_at_the_ball(place):
    """Exactly, if nothing is wrong."""
    found = locate(*look(place), CAMERA, ACROSS)
    assert found.problem == ""
    np.testing.assert_allclose(found.place, place, atol=1e-9)


@settings(max_examples=100, deadline=None)
@given(PLACES)
def test_exchanged_pictures_are_told_from_good_ones(place):
    """Each eye shows what the other one should; unless both look at the ball, where that is the same."""
    good = look(place)
    assume(abs(good.left.pixel[0] - good.right.pixel[0]) > 12.0)
    assert not swapped(good, CAMERA, ACROSS)
    assert locate(good.right, good.left, CAMERA, ACROSS).place is None
    assert swapped(Look(good.right, good.left), CAMERA, ACROSS)


@pytest.mark.parametrize(
    ("left", "right", "problem"),
    [
        ((0.0, 0.0, 0.4), (0.0, 0.03, 0.4), "their rays pass"),
        ((0.0, 0.0, 0.4), (0.03, 0.0, 0.4), "by both the ball is"),
    ],
)
def test_pictures_of_two_moments_do_not_agree(left, right, problem):
    """Above each other the rays miss; beside each other the distance is not that by the size."""
    found = locate(seen(left), seen(right, ACROSS), CAMERA, ACROSS)
    assert found.place is None
    assert problem in found.problem


def test_the_eye_that_does_not_follow_the_ball_is_named():
    """One, both, none; an eye that does not see it is not judged."""
    before, after = look((0.0, 0.0, 0.4)), look((0.04, 0.0, 0.4))
    assert frozen(before, after) == []
    assert frozen(before, Look(before.left, after.right)) == ["left"]
    assert frozen(before, before) == ["left", "right"]
    assert frozen(before, Look(None, before.right)) == ["right"]
    assert not swapped(Look(None, before.right), CAMERA, ACROSS)
