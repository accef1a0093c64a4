"""A robot of the network on topics of ROS 1, see :mod:`rtf.ros.bridge`."""

from __future__ import annotations

from itertools import count
from typing import TYPE_CHECKING, Any

from rtf.ros import bridge
from rtf.ros.topics import RobotTopics
from rtf.ros1 import messages

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.ports.network import Network
    from rtf.ros1.node import Node


class Topics(RobotTopics):
    """The topics of a robot on a node. The messages of each are counted."""

    messages = messages

    def headers(self) -> Callable[[float, str], Any]:
        numbers = count()
        return lambda seconds, frame: messages.Header(next(numbers) % (1 << 32), messages.time_of(seconds), frame)

    def time(self, seconds: float) -> Any:
        return messages.time_of(seconds)


class RobotBridge(bridge.RobotBridge):
    """Publishes a robot of ``network`` on topics of ``node`` until it is closed. States have the ``rate`` in Hz."""

    def __init__(self, node: Node, network: Network, *, rate: float = 100.0) -> None:
        super().__init__(Topics(node), network, ports=f"/ros1/{node.name}", rate=rate)
