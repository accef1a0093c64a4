"""``rtf ros1``: publish a robot of the network on topics of ROS 1."""

from __future__ import annotations

from contextlib import closing
from functools import partial
from typing import TYPE_CHECKING

from rtf.cli import robot_topics
from rtf.cli.parser import Parser

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence
    from contextlib import ExitStack

    from rtf.middleware.ports.network import Network
    from rtf.ros.bridge import RobotBridge

_EPILOG = """\
It publishes only; nothing is moved. Programs of ROS 1 find the topics at the master of ROS_MASTER_URI:
  /joint_states   the parts that are named, in rad and m
  TOPIC           pictures (sensor_msgs/Image), forces (geometry_msgs/WrenchStamped), inertial units (Imu)
  /clock          of a simulation whose clock this program has (YARP_CLOCK)
Other machines reach this one at ROS_HOSTNAME or ROS_IP; without them, only this machine does.

examples:
  roscore &
  rtf simulator &
  rtf ros1 --robot icubSim --parts left_arm,head --image /icubSim/cam/left=camera/left/image_raw
  rostopic hz /joint_states
"""


def ros1(words: Sequence[str]) -> int:
    """Publish until a signal; returns the exit code."""
    parser = Parser(prog="rtf ros1", description="Publish a robot of the network on topics of ROS 1.", epilog=_EPILOG)
    robot_topics.add_options(parser)
    parser.add_argument("--master", metavar="URI", help="the master (default: ROS_MASTER_URI, else localhost:11311)")
    options = parser.parse_args(words)
    robot_topics.check_options(parser, options)
    return robot_topics.publish_until_signal(options, partial(_bridge, options))


def _bridge(options: argparse.Namespace, network: Network, opened: ExitStack) -> RobotBridge:
    from rtf.ros1.bridge import RobotBridge
    from rtf.ros1.node import Node

    node = Node(options.node, options.namespace, master=options.master, report=network.report)
    opened.enter_context(node)
    return opened.enter_context(closing(RobotBridge(node, network, rate=options.rate)))
