"""What ``rtf ros1`` and ``rtf ros2`` share: the options that say what is published, and the run until a signal."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import ExitStack

    from rtf.cli.parser import Parser
    from rtf.middleware.ports.network import Network
    from rtf.robot.boards.client import RemoteBoard
    from rtf.ros.bridge import RobotBridge


def add_options(parser: Parser) -> None:
    """Add the options of the robot, its topics and the node."""
    parser.add_argument("--robot", metavar="NAME", default="icub", help="the beginning of its ports (default: icub)")
    parser.add_argument("--parts", metavar="A,B", default="", help="its parts, such as left_arm,head")
    parser.add_argument("--rate", metavar="HZ", type=float, default=100.0, help="of the states (default: 100)")
    sources = {
        "--image": "a port of pictures",
        "--wrench": "a port of a force-torque sensor",
        "--imu": "a port of an inertial unit, such as /icub/inertial",
    }
    for option, what in sources.items():
        parser.add_argument(
            option, metavar="/PORT=TOPIC", type=_pair, action="append", default=[], help=f"{what}, and its topic"
        )
    parser.add_argument("--node", metavar="NAME", default="rtf", help="the name of the node (default: rtf)")
    parser.add_argument("--namespace", metavar="/NAME", default="/", help="of the node and its topics (default: /)")


def check_options(parser: Parser, options: argparse.Namespace) -> None:
    """End with the usage if there is nothing to publish."""
    if not (options.parts or options.image or options.wrench or options.imu):
        parser.error("nothing to publish: name --parts, --image, --wrench or --imu")


def publish_until_signal(
    options: argparse.Namespace,
    make_bridge: Callable[[Network, ExitStack], RobotBridge],
    serve: Callable[[dict[str, RemoteBoard], Network, ExitStack], None] = lambda _, __, ___: None,
) -> int:
    """Publish what the options name, through a bridge; returns the exit code. ``serve`` does more with the boards."""
    from rtf import clock
    from rtf.cli.network.options import make_network
    from rtf.middleware.clocks.network_clock import clock_from_environment
    from rtf.robot.interface.network_program import run_program, say

    def start(opened: ExitStack) -> None:
        network = make_network()
        network.report = say
        opened.enter_context(clock.use(clock_from_environment(network)))
        bridge = make_bridge(network, opened)
        serve(_add_sources(options, network, opened, bridge), network, opened)
        bridge.start()

    return run_program(f"the node {options.node}", start)


def _add_sources(
    options: argparse.Namespace, network: Network, opened: ExitStack, bridge: RobotBridge
) -> dict[str, RemoteBoard]:
    """Have the bridge publish what the options name; returns the boards of the parts."""
    from rtf.robot.boards.client import connect

    boards = {}
    for part in filter(None, options.parts.split(",")):
        place = f"/{options.robot.strip('/')}/{part}"
        boards[part] = opened.enter_context(connect(place, carrier="tcp", network=network, strict=True))
        bridge.add_part(part, boards[part])
    for source, topic in options.image:
        bridge.add_camera(source, topic)
    for source, topic in options.wrench:
        bridge.add_wrench(source, topic)
    for source, topic in options.imu:
        bridge.add_imu(source, topic)
    opened.callback(bridge.close)  # before the boards
    return boards


def _pair(text: str) -> tuple[str, str]:
    port, _, topic = text.partition("=")
    if not port.startswith("/") or not topic:
        raise argparse.ArgumentTypeError(f"{text!r} is not /PORT=TOPIC")
    return port, topic
