"""``rtf ros2``: publish a robot of the network on topics of ROS 2."""

from __future__ import annotations

import argparse
from contextlib import closing
from typing import TYPE_CHECKING

from rtf.cli.parser import Parser

if TYPE_CHECKING:
    from collections.abc import Sequence
    from contextlib import ExitStack

    from rtf.middleware.ports.network import Network

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
    parser.add_argument("--robot", metavar="NAME", default="icub", help="the beginning of its ports (default: icub)")
    parser.add_argument("--parts", metavar="A,B", default="", help="its parts, such as left_arm,head")
    parser.add_argument("--rate", metavar="HZ", type=float, default=100.0, help="of the states (default: 100)")
    for option, what in (("--image", "a port of pictures"), ("--wrench", "a port of a force-torque sensor")):
        parser.add_argument(
            option, metavar="/PORT=TOPIC", type=_pair, action="append", default=[], help=f"{what}, and its topic"
        )
    parser.add_argument("--node", metavar="NAME", default="rtf", help="the name of the node (default: rtf)")
    parser.add_argument("--namespace", metavar="/NAME", default="/", help="of the node and its topics (default: /)")
    parser.add_argument("--domain", metavar="N", type=int, help="the domain (default: ROS_DOMAIN_ID, else 0)")
    options = parser.parse_args(words)
    if not (options.parts or options.image or options.wrench):
        parser.error("nothing to publish: name --parts, --image or --wrench")
    try:
        return _run(options)
    except ImportError as error:
        if "cyclonedds" not in str(error):
            raise
        from rtf.ros2.errors import MissingPackageError

        raise MissingPackageError(f"ROS 2 needs the package cyclonedds: pip install 'rtf[dds]' ({error})") from error


def _pair(text: str) -> tuple[str, str]:
    port, _, topic = text.partition("=")
    if not port.startswith("/") or not topic:
        raise argparse.ArgumentTypeError(f"{text!r} is not /PORT=TOPIC")
    return port, topic


def _run(options: argparse.Namespace) -> int:
    from rtf import clock
    from rtf.cli.network.options import make_network
    from rtf.middleware.clocks.network_clock import clock_from_environment
    from rtf.robot.interface.network_program import run_program, say

    def start(opened: ExitStack) -> None:
        network = make_network()
        network.report = say
        opened.enter_context(clock.use(clock_from_environment(network)))
        _start(options, network, opened)

    return run_program(f"the node {options.node}", start)


def _start(options: argparse.Namespace, network: Network, opened: ExitStack) -> None:
    from rtf.robot.boards.client import connect
    from rtf.ros2.bridge import RobotBridge
    from rtf.ros2.node import Node

    node = opened.enter_context(Node(options.node, options.namespace, domain=options.domain))
    bridge = opened.enter_context(closing(RobotBridge(node, network, rate=options.rate)))
    for part in filter(None, options.parts.split(",")):
        place = f"/{options.robot.strip('/')}/{part}"
        bridge.add_part(part, opened.enter_context(connect(place, carrier="tcp", network=network)))
    for source, topic in options.image:
        bridge.add_camera(source, topic)
    for source, topic in options.wrench:
        bridge.add_wrench(source, topic)
    bridge.start()
