"""``rtf ros2``: publish a robot of the network on topics of ROS 2."""

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
It publishes only; nothing is moved. ROS 2 programs of this machine find the topics in the domain of ROS_DOMAIN_ID:
  /joint_states   the parts that are named, in rad and m
  TOPIC           pictures (sensor_msgs/Image), and forces (geometry_msgs/WrenchStamped)
  /clock          of a simulation whose clock this program has (YARP_CLOCK)
Other machines are reached by a CYCLONEDDS_URI of yours, as with ROS 2.

examples:
  rtf simulator &
  rtf ros2 --robot icubSim --parts left_arm,head --image /icubSim/cam/left=camera/left/image_raw
  ros2 topic hz /joint_states
"""


def ros2(words: Sequence[str]) -> int:
    """Publish until a signal; returns the exit code."""
    parser = Parser(prog="rtf ros2", description="Publish a robot of the network on topics of ROS 2.", epilog=_EPILOG)
    robot_topics.add_options(parser)
    parser.add_argument("--domain", metavar="N", type=int, help="the domain (default: ROS_DOMAIN_ID, else 0)")
    options = parser.parse_args(words)
    robot_topics.check_options(parser, options)
    try:
        return robot_topics.publish_until_signal(options, partial(_bridge, options))
    except ImportError as error:
        if "cyclonedds" not in str(error):
            raise
        from rtf.ros2.errors import MissingPackageError

        raise MissingPackageError(f"ROS 2 needs the package cyclonedds: pip install 'rtf[dds]' ({error})") from error


def _bridge(options: argparse.Namespace, network: Network, opened: ExitStack) -> RobotBridge:
    from rtf.ros2.bridge import RobotBridge
    from rtf.ros2.node import Node

    node = opened.enter_context(Node(options.node, options.namespace, domain=options.domain))
    return opened.enter_context(closing(RobotBridge(node, network, rate=options.rate)))
