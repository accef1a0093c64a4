"""Kinematics of a description, and series of orientations."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot_testing.judging.kinematics import (
    DescriptionError,
    KinematicModel,
    rotation_about,
    rotation_of,
    rotation_vector,
)
from rtf.robot_testing.judging.orientations import turn_between, turns_of, vertical_turn

ARM = """<robot name="arm">
<link name="base"/><link name="upper"/><link name="fore"/><link name="tool"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
  <origin xyz="0 0 1"/><axis xyz="0 0 2"/><limit lower="-1" upper="2"/></joint>
<joint name="slide" type="prismatic"><parent link="upper"/><child link="fore"/>
  <origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/><axis xyz="1 0 0"/><limit lower="0" upper="1"/></joint>
<joint name="hold" type="fixed"><parent link="fore"/><child link="tool"/><origin xyz="0 0 0.5"/></joint>
</robot>"""

angles = st.floats(-3.1, 3.1)
vectors = st.tuples(angles, angles, angles).map(np.array)


@pytest.fixture
def arm(tmp_path):
    """An arm with a revolute, a prismatic and a fixed joint."""
    path = tmp_path / "arm.urdf"
    path.write_text(ARM, encoding="utf-8")
    return KinematicModel.read(path)


def test_transforms_follow_the_joints(arm):
    """Revolute and prismatic joints add up along the chain; an axis of any length is a direction."""
    found = arm.transform("tool", {"shoulder": math.pi / 2, "slide": 0.25})
    assert found[:3, 3] == pytest.approx([-0.25, 1.0, 1.5])
    assert found[:3, :3] == pytest.approx(rotation_of(0, 0, math.pi))
    assert arm.chain("tool") == ["shoulder", "slide"]
    assert arm.limits("shoulder") == (-1.0, 2.0)


def test_an_unknown_link_is_named(arm):
    """The error has the file and the name of the link."""
    with pytest.raises(DescriptionError, match=r"arm\.urdf.*'thumb'"):
        arm.transform("thumb", {})


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("</robot>", ""), "cannot read a robot description"),
        (('type="revolute"', 'type="rubber"'), "rubber"),
        (('<axis xyz="1 0 0"/>', '<axis xyz="0 0 0"/>'), "no direction"),
        (('xyz="0 0 1"', 'xyz="0 nan 1"'), "three numbers"),
        (('<child link="tool"/>', '<child link="upper"/>'), "two joints"),
        (('lower="-1"', 'lower="low"'), "lower"),
    ],
)
def test_a_wrong_description_is_refused(tmp_path, change, said):
    """The error names the file and the problem."""
    path = tmp_path / "wrong.urdf"
    path.write_text(ARM.replace(*change), encoding="utf-8")
    with pytest.raises(DescriptionError, match=rf"wrong\.urdf.*{said}"):
        KinematicModel.read(path)


def test_a_circle_of_joints_is_refused(tmp_path):
    """Links that are connected in a circle are an error, not an endless search."""
    path = tmp_path / "circle.urdf"
    path.write_text(ARM.replace('<parent link="base"/>', '<parent link="tool"/>'), encoding="utf-8")
    with pytest.raises(DescriptionError, match="circle"):
        KinematicModel.read(path).transform("tool", {})


@given(vectors)
def test_a_rotation_and_its_vector_are_inverse(vector):
    """The vector of a rotation gives that rotation again, with at most half a turn."""
    rotation = rotation_about(vector)
    back = rotation_vector(rotation)
    assert np.linalg.norm(back) <= math.pi + 1e-9
    assert rotation_about(back) == pytest.approx(rotation, abs=1e-6)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, 0, 0.8), (0, 0.6, -0.8)])
def test_half_a_turn_has_an_axis(axis):
    """The axis of half a turn is found, where the sine is 0."""
    vector = rotation_vector(rotation_about(np.array(axis) * math.pi))
    assert np.abs(vector) == pytest.approx(np.abs(np.array(axis)) * math.pi, abs=1e-6)
    assert rotation_about(vector) == pytest.approx(rotation_about(np.array(axis) * math.pi), abs=1e-6)


@given(st.floats(-3.0, 3.0), st.lists(vectors, min_size=1, max_size=5))
def test_the_heading_between_two_series_is_found(heading, turns):
    """A rotation about the vertical is found for all orientations."""
    wanted = np.array([rotation_about(vector) for vector in turns])
    found = rotation_of(0, 0, -heading) @ wanted
    assert vertical_turn(found, wanted) == pytest.approx(heading, abs=1e-6)


@given(vectors)
def test_the_turn_between_vectors_is_found(vector):
    """Vectors of all directions show the rotation between them."""
    rotation = rotation_about(vector)
    found = np.vstack([np.eye(3), [0.3, -0.5, 0.8]])
    assert turn_between(found, found @ rotation.T) == pytest.approx(rotation, abs=1e-6)


def test_angular_velocities_are_in_the_moving_frame():
    """A frame that lies on its side and turns about the vertical turns about its own horizontal axis."""
    times = np.arange(30) * 0.01
    lying = rotation_of(math.pi / 2, 0, 0)
    rotations = np.array([rotation_of(0, 0, math.radians(50.0) * time) @ lying for time in times])
    assert turns_of(rotations, times, 10) == pytest.approx(np.tile([0.0, 50.0, 0.0], (20, 1)), abs=1e-6)
