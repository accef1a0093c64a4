"""The places where motors are tested by their duty cycles have room for their joints, in the simulated robot."""

import numpy as np
import pytest

from icub import AXES, INDEX, PARTS, build_icub
from rtf.robot.model.engine import mujoco
from rtf.robot_testing.duty_test import NEAR, ROOM
from rtf.robot_testing.motion.duty_ramp import away_from_limits
from rtf.simulator.contacts import touching
from rtf.simulator.plant import Options

THRESHOLD = 5.0  # deg, what the tests have without being told


class Limits:
    """The attributes of a part that are needed."""

    def __init__(self, axes):
        self.low, self.high, self.home = (
            np.array([getattr(axis, name) for axis in axes]) for name in ("minimum", "maximum", "home")
        )


@pytest.fixture(scope="module")
def robot():
    """The model with its outlines."""
    return build_icub(Options())


@pytest.mark.parametrize("part", PARTS)
def test_no_joint_collides_where_its_motor_is_tested(robot, part):
    """All others are at home; the joint moves as far to both sides as a ramp may, from its start."""
    data, axes = robot.data(), PARTS[part]
    for joint, axis in enumerate(axes):
        place = away_from_limits(Limits(axes), joint, THRESHOLD + ROOM)
        for away in np.linspace(-THRESHOLD - NEAR, THRESHOLD + NEAR, 15):
            pose = np.radians([one.home for one in AXES])
            pose[INDEX[axis.name]] = np.radians(place + away)
            data.qpos[:] = robot.pose(pose)
            mujoco().mj_forward(robot.model, data)
            assert touching(robot.model, data) == [], f"{axis.name} at {place + away:.1f} deg"
            assert axis.minimum < place + away < axis.maximum
