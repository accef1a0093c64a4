"""``rtf can-boards``: emulated boards on CAN buses, for drivers and hosts of other programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rtf.cli.parser import Parser, count, parts
from rtf.robot.model.names import DEFAULT_ROBOT

if TYPE_CHECKING:
    from collections.abc import Sequence

_EPILOG = """\
examples:
  rtf can-boards                                           all buses of the iCub, as datagrams on this machine
  rtf can-boards --parts left_arm
  rtf can-boards --interface socketcan --channel can{}     buses can0, can1 …, which exist
  rtf can scan --interface udp_multicast                   in another terminal: the boards that answer

The motors are off until a host has configured the boards. The robot is simulated in real time.
The first SIGINT or SIGTERM ends it.

exit codes:
  0 it ended because it was asked to   1 it was not started   4 usage
"""


def can_boards(words: Sequence[str]) -> int:
    """Run emulated boards until a signal ends them; return the exit code."""
    from rtf.robot.devices.can.bus_settings import GROUPS, MULTICAST, MULTICAST_GROUP, MULTICAST_PORT
    from rtf.robot.model import load_robot
    from rtf.simulator.firmware.program import BoardsProgram, run_boards, write_files

    parser = Parser(
        prog="rtf can-boards",
        description="Run the boards of a simulated robot, each with its own firmware, on CAN buses.",
        epilog=_EPILOG,
    )
    parser.add_argument(
        "--model", default=DEFAULT_ROBOT, metavar="ROBOT", help="robot, by name or folder (default: %(default)s)"
    )
    parser.add_argument(
        "--parts", type=parts, default=(), metavar="A,B", help="the parts whose boards there are (default: all)"
    )
    parser.add_argument(
        "--drives",
        type=parts,
        default=(),
        metavar="A,B",
        help="the parts that have a board for each motor, which drives it; others have boards of joints",
    )
    parser.add_argument(
        "--interface", default=MULTICAST, metavar="NAME", help="interface of python-can (default: %(default)s)"
    )
    parser.add_argument(
        "--channel",
        default=MULTICAST_GROUP,
        help="its channel; {} is replaced by the number of the bus (default: %(default)s, one port a bus)",
    )
    parser.add_argument(
        "--port", type=count, default=MULTICAST_PORT, help="of the first bus in datagrams (default: %(default)s)"
    )
    parser.add_argument("--seed", type=count, default=0, help="of the random numbers (default: 0)")
    parser.add_argument("--unit", type=count, default=0, help="robot of the population (default: 0, the nominal one)")
    parser.add_argument(
        "--files",
        metavar="DIR",
        type=Path,
        help="only write the configuration of their drivers for 'rtf robotinterface' to a folder",
    )
    options = parser.parse_args(words)
    if options.interface not in GROUPS and "{}" not in options.channel:
        parser.error("argument --channel: write {} where the number of the bus belongs, such as can{}")
    model = load_robot(options.model)
    for name, chosen in (("parts", options.parts), ("drives", options.drives)):
        if unknown := [part for part in chosen if part not in model.parts]:
            there = ", ".join(model.parts)
            parser.error(f"argument --{name}: there is no part {', '.join(unknown)!r}; there are {there}")
    program = BoardsProgram(
        model,
        options.interface,
        options.channel,
        options.port,
        options.parts,
        options.seed,
        options.unit,
        options.drives,
    )
    return run_boards(program) if options.files is None else write_files(program, options.files)
