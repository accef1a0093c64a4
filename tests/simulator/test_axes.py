"""The table of axes."""

from __future__ import annotations

import numpy as np
import pytest

from icub import AXES, COUPLINGS, INDEX, PARTS, joint_to_motor, part_slice
from rtf.robot.errors import RefusedError

FINGERS = [
    "hand_finger",
    "thumb_oppose",
    "thumb_proximal",
    "thumb_distal",
    "index_proximal",
    "index_distal",
    "middle_proximal",
    "middle_distal",
    "pinky",
]


def names(part: str) -> list[str]:
    """Names of a part's axes."""
    return [axis.name for axis in PARTS[part]]


class TestOrder:
    """The order is the robot's."""

    def test_parts_come_in_the_robots_order_with_the_robots_counts(self):
        """The parts have the order in which the robot lists its joints."""
        expected = [("head", 6), ("left_arm", 16), ("right_arm", 16), ("torso", 3), ("left_leg", 6), ("right_leg", 6)]
        assert [(part, len(axes)) for part, axes in PARTS.items()] == expected

    def test_all_axes_are_the_parts_one_after_the_other(self):
        """There are 53 axes, each of them once, and each names its part."""
        assert len(AXES) == len({axis.name for axis in AXES}) == 53
        assert [axis.name for axis in AXES] == [name for part in PARTS for name in names(part)]
        assert all(axis.part == part for part, axes in PARTS.items() for axis in axes)

    def test_torso_is_numbered_by_its_board(self):
        """The board counts yaw, roll, pitch, which is not the order of the links."""
        assert names("torso") == ["torso_yaw", "torso_roll", "torso_pitch"]

    def test_head_and_limbs_are_numbered_by_their_boards(self):
        """Left and right limbs have the same numbers."""
        assert names("head") == [
            "neck_pitch", "neck_roll", "neck_yaw", "eyes_tilt", "eyes_version", "eyes_vergence"
        ]  # fmt: skip
        arm = ["shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_prosup", "wrist_pitch", "wrist_yaw"]
        leg = ["hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll"]
        for side, letter in (("left", "l"), ("right", "r")):
            assert names(f"{side}_arm") == [f"{letter}_{joint}" for joint in arm + FINGERS]
            assert names(f"{side}_leg") == [f"{letter}_{joint}" for joint in leg]

    @pytest.mark.parametrize("part", PARTS)
    def test_slice_of_a_part_holds_its_axes(self, part: str):
        """A part's columns are next to each other."""
        assert AXES[part_slice(part)] == PARTS[part]

    def test_index_is_the_place(self):
        """The index finds an axis by its name."""
        assert all(AXES[place].name == name for name, place in INDEX.items())

    def test_unknown_part_is_named(self):
        """The error lists the known parts."""
        with pytest.raises(RefusedError, match=r"no part 'tail'.*right_leg"):
            part_slice("tail")


class TestValues:
    """Numbers of the table agree with each other."""

    @pytest.mark.parametrize("axis", AXES, ids=lambda axis: axis.name)
    def test_home_is_within_the_limits_and_the_drive_is_of_this_world(self, axis):
        """Home is within the limits; torques, speeds and gears are positive."""
        assert axis.minimum <= axis.home <= axis.maximum
        assert axis.minimum < axis.maximum
        positive = ("max_velocity", "max_torque", "encoder_resolution", "rotor_resolution", "armature", "damping")
        assert all(getattr(axis, name) > 0 for name in positive)
        assert 0 < axis.friction < 0.1 * axis.max_torque
        assert abs(axis.gearbox) >= 1
        assert axis.nominal_current < axis.peak_current < axis.overload_current

    def test_both_sides_have_the_same_limits(self):
        """The robot is symmetric but for the way its motors are mounted."""
        for left in AXES:
            if left.name.startswith("l_"):
                right = AXES[INDEX["r" + left.name[1:]]]
                assert (left.minimum, left.maximum, left.home) == (right.minimum, right.maximum, right.home)
                assert abs(left.gearbox) == abs(right.gearbox)


class TestCouplings:
    """Motors and joints."""

    @pytest.mark.parametrize("part", PARTS)
    def test_blocks_cover_all_joints_of_the_part_once(self, part: str):
        """One block a board, one after the other."""
        blocks = COUPLINGS[part]
        assert [block.first for block in blocks] == list(np.cumsum([0, *(block.size for block in blocks[:-1])]))
        assert sum(block.size for block in blocks) == len(PARTS[part])
        assert all(len(row) == block.size for block in blocks for row in block.joint_to_motor)

    @pytest.mark.parametrize("part", PARTS)
    def test_joints_follow_from_motors(self, part: str):
        """Joints computed from motors that were computed from joints are the same."""
        joints = np.arange(1.0, len(PARTS[part]) + 1)
        motors = joint_to_motor(part) @ joints
        for block in COUPLINGS[part]:
            span = slice(block.first, block.first + block.size)
            np.testing.assert_allclose(block.motor_to_joint @ motors[span], joints[span], atol=1e-12)

    def test_shoulder_motors_pull_more_than_one_joint(self):
        """A degree of roll is 1.625 of the second motor, a degree of pitch as much the other way round."""
        motors = joint_to_motor("left_arm") @ np.array([1.0, 10.0, 100.0, *[0.0] * 13])
        np.testing.assert_allclose(motors[:3], [1.0, 1.625 * 9, 162.5])

    def test_torso_is_a_differential(self):
        """Roll and pitch share two motors; yaw has its own."""
        np.testing.assert_allclose(joint_to_motor("torso") @ [5.0, 10.0, 4.0], [5.0, 3.0, 7.0])

    def test_legs_are_not_coupled(self):
        """Each motor moves one joint."""
        np.testing.assert_array_equal(joint_to_motor("left_leg"), np.eye(6))
