"""A robot of the network on topics of ROS 2, see :mod:`rtf.ros.bridge`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.ros import bridge
from rtf.ros.topics import RobotTopics
from rtf.ros2 import messages
from rtf.ros2.messages import Header, Time

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.ports.network import Network
    from rtf.ros2.node import Node


class Topics(RobotTopics):
    """The topics of a robot on a node."""

    messages = messages

    def headers(self) -> Callable[[float, str], Header]:
        return lambda seconds, frame: Header(Time.of(seconds), frame)

    def time(self, seconds: float) -> Time:
        return Time.of(seconds)


class RobotBridge(bridge.RobotBridge):
    """Publishes a robot of ``network`` on topics of ``node`` until it is closed. States have the ``rate`` in Hz."""

    def __init__(self, node: Node, network: Network, *, rate: float = 100.0) -> None:
        super().__init__(Topics(node), network, ports=f"/ros2/{node.name}", rate=rate)
