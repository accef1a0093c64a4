"""``rtf ros2``: publish a robot of the network on topics of ROS 2."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.cli import robot_topics
from rtf.cli.parser import Parser

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence
    from contextlib import ExitStack

    from rtf.middleware.ports.network import Network
    from rtf.robot.boards.client import RemoteBoard
    from rtf.ros.bridge import RobotBridge

_EPILOG = """\
ROS 2 programs of this machine find the topics in the domain of ROS_DOMAIN_ID:
  /joint_states       the parts that are named, in rad and m
  /robot_description  their limits, or the URDF of --description
  TOPIC               pictures (sensor_msgs/Image), forces (geometry_msgs/WrenchStamped), inertial units (Imu)
  /clock              of a simulation whose clock this program has (YARP_CLOCK)
With --commands the parts obey, too; otherwise nothing is moved. PART_position_controller/commands, and those of
velocity and effort, take std_msgs/Float64MultiArray, PART_trajectory_controller/joint_trajectory takes
trajectory_msgs/JointTrajectory. A part obeys the program that has sent it a command until that ends. The service
NODE/stop (std_srvs/Trigger) stops all. A real robot obeys with --allow-motion only.
Other machines are reached by a CYCLONEDDS_URI of yours, as with ROS 2.

examples:
  rtf simulator &
  rtf ros2 --robot icubSim --parts left_arm,head --image /icubSim/cam/left=camera/left/image_raw
  ros2 topic hz /joint_states
  rtf ros2 --robot icubSim --parts head --commands
"""


def ros2(words: Sequence[str]) -> int:
    """Publish until a signal; returns the exit code."""
    what = "Publish a robot of the network on topics of ROS 2, and take commands."
    parser = Parser(prog="rtf ros2", description=what, epilog=_EPILOG)
    robot_topics.add_options(parser)
    parser.add_argument("--domain", metavar="N", type=int, help="the domain (default: ROS_DOMAIN_ID, else 0)")
    parser.add_argument(
        "--description", metavar="URDF", type=Path, help="a file, published instead of the limits alone"
    )
    parser.add_argument("--commands", action="store_true", help="the parts obey commands")
    parser.add_argument("--allow-motion", action="store_true", help="also those of a robot that is not simulated")
    options = parser.parse_args(words)
    if options.commands and not options.parts:
        parser.error("argument --commands: name the --parts that obey")
    robot_topics.check_options(parser, options)
    try:
        program = _Program(options)
        return robot_topics.publish_until_signal(options, program.open_bridge, program.serve)
    except ImportError as error:
        if "cyclonedds" not in str(error):
            raise
        from rtf.ros2.errors import MissingPackageError

        raise MissingPackageError(f"ROS 2 needs the package cyclonedds: pip install 'rtf[dds]' ({error})") from error


class _Program:
    """The node of the program, its bridge, and what obeys commands."""

    def __init__(self, options: argparse.Namespace) -> None:
        self._options = options

    def open_bridge(self, network: Network, opened: ExitStack) -> RobotBridge:
        from rtf.ros2.bridge import RobotBridge
        from rtf.ros2.node import Node

        options = self._options
        self._node = opened.enter_context(
            Node(options.node, options.namespace, domain=options.domain, report=network.report)
        )
        return opened.enter_context(closing(RobotBridge(self._node, network, rate=options.rate)))

    def serve(self, boards: dict[str, RemoteBoard], network: Network, opened: ExitStack) -> None:
        """Publish the description of the boards, and have them obey if that is asked for."""
        from rtf.ros2.robot_server import RobotServer, publish_description

        options, robot = self._options, self._options.robot.strip("/")
        if boards:
            text = options.description.read_text(encoding="utf-8") if options.description else ""
            publish_description(self._node, robot, boards, text)
        if options.commands:
            for part in boards:
                _require_permission(network, robot, part, allowed=options.allow_motion)
            opened.enter_context(closing(RobotServer(self._node, boards, network.report)))


def _require_permission(network: Network, robot: str, part: str, *, allowed: bool) -> None:
    from rtf import clock
    from rtf.middleware.clocks.network_clock import LockstepClock
    from rtf.robot_testing.guard.simulated import is_simulated
    from rtf.ros2.errors import Ros2Error

    if isinstance(clock.current(), LockstepClock):
        raise Ros2Error("commands of ROS 2 need a time that passes by itself: start the simulator without --lockstep")
    if not (allowed or is_simulated(network, robot, part)):
        raise Ros2Error(f"/{robot}/{part} is not simulated: with --allow-motion it obeys whatever is on the topics")
