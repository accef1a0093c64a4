"""A robot on topics of ROS 1, of a real master, and the conversions of values."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ros_bridge_contract import BridgeContract

from rtf.ros.robot import quaternion_of
from rtf.ros1 import messages
from rtf.ros1.bridge import RobotBridge
from rtf.ros1.messages import seconds_of, time_of

if TYPE_CHECKING:
    from ros1.conftest import Ros


class TestBridge(BridgeContract):
    """The bridge keeps the contract; ``rostopic`` shows states, and each has a number."""

    bridge = RobotBridge
    messages = messages

    @pytest.fixture(autouse=True)
    def _of(self, ros: Ros) -> None:
        self.ros = ros

    def seconds(self, stamp: Any) -> float:
        """See BridgeContract."""
        return seconds_of(stamp)

    def while_it_publishes(self) -> None:
        """See BridgeContract."""
        assert "position: [1.57" in self.ros.run("rostopic", "echo", "-n", "1", "/joint_states")
        numbers = [one.header.seq for one in self.got]
        assert numbers == [*range(numbers[0], numbers[0] + len(numbers))]


@given(*[st.floats(-180, 180)] * 3)
def test_quaternions_turn_as_the_angles_do(roll: float, pitch: float, yaw: float):
    """First about x, then about y, then about z."""
    x, y, z, w = quaternion_of(roll, pitch, yaw)
    turned = np.eye(3) + 2 * w * _cross([x, y, z]) + 2 * _cross([x, y, z]) @ _cross([x, y, z])
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(one), math.cos(one)) for one in np.radians([roll, pitch, yaw]))
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    assert turned == pytest.approx(about_z @ about_y @ about_x, abs=1e-9)


def _cross(axis: list[float]) -> np.ndarray:
    """The matrix that multiplies crosswise."""
    x, y, z = axis
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


@pytest.mark.parametrize("seconds", [0.0, 1.5, 1.8e9, 2.0**31 - 1])
def test_times_are_those_of_ros(seconds: float):
    """Whole seconds, and billionths."""
    assert seconds_of(time_of(seconds)) == pytest.approx(seconds, abs=1e-6)


@pytest.mark.parametrize(("seconds", "found"), [(-1.0, 0.0), (1e12, 2.0**31 - 1)])
def test_times_that_do_not_fit(seconds: float, found: float):
    """Are the nearest that do."""
    assert seconds_of(time_of(seconds)) == pytest.approx(found, abs=1.0)
