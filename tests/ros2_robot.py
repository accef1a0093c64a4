"""A robot of ROS 2 in this process: a board of three joints behind its ports, the bridge, and controllers."""

from __future__ import annotations

from contextlib import ExitStack, closing, contextmanager
from typing import TYPE_CHECKING, NamedTuple

from rtf.robot.boards.client import RemoteBoard, connect
from rtf.robot.devices.fake_board import FakeBoard
from rtf.ros2.bridge import RobotBridge
from rtf.ros2.robot_server import RobotServer, publish_description
from served import served

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.middleware.ports.network import Network
    from rtf.ros2.node import Node


class RosRobot(NamedTuple):
    """The board, its client of the bridge, and what was reported."""

    board: FakeBoard
    client: RemoteBoard
    said: list[str]


@contextmanager
def ros_robot(node: Callable[..., Node], network: Network) -> Iterator[RosRobot]:
    """Serve the part ``arm`` of three joints, 0 to 100 deg, to ROS 2."""
    board, said = FakeBoard("board", network=network), []
    with ExitStack() as opened:
        opened.enter_context(served(board, "/robot/arm", network=network, period=0.005))
        client = opened.enter_context(connect("/robot/arm", carrier="tcp", network=network, strict=True, timeout=10.0))
        here = node("bridge")
        bridge = opened.enter_context(closing(RobotBridge(here, network, rate=200.0)))
        bridge.add_part("arm", client)
        publish_description(here, "robot", {"arm": client})
        opened.enter_context(closing(RobotServer(here, {"arm": client}, said.append)))
        bridge.start()
        yield RosRobot(board, client, said)
