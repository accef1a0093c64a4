"""A robot on topics of ROS 2, by real DDS."""

from __future__ import annotations

from typing import Any

from ros_bridge_contract import BridgeContract

from rtf.ros2 import messages
from rtf.ros2.bridge import RobotBridge


class TestBridge(BridgeContract):
    """The bridge keeps the contract."""

    bridge = RobotBridge
    messages = messages

    def seconds(self, stamp: Any) -> float:
        """See BridgeContract."""
        return float(stamp.seconds)
