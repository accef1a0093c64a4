"""Queues of joints that share motors."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from rtf.robot_testing.motion.joint_queues import one_motor_at_a_time


def test_joints_that_share_a_motor_are_apart():
    """In the order of their group, and beside those that do not."""
    pairs = {1: {1, 2}, 2: {1, 2}}
    found = one_motor_at_a_time([[[5]], [[0, 1, 2, 3], [4]]], lambda joint: pairs.get(joint, {joint}))
    assert found == [[[5]], [[0, 1, 3], [2], [4]]]


@given(st.lists(st.integers(0, 3), max_size=8))
def test_each_joint_is_in_one_group(motors: list[int]):
    """And no two of a group have the same motor."""
    (queue,) = one_motor_at_a_time(
        [[range(len(motors))]], lambda joint: [one for one, motor in enumerate(motors) if motor == motors[joint]]
    )
    assert sorted(joint for group in queue for joint in group) == [*range(len(motors))]
    assert all(len({motors[joint] for joint in group}) == len(group) for group in queue)
