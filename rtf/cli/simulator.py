"""``rtf simulator``: start a simulated robot, list its faults, and send commands to one that runs."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.cli.parser import Parser, add_dialect, count, key_value, parts, seconds
from rtf.errors import RtfError
from rtf.robot.model.names import DEFAULT_ROBOT
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.simulator.faults import Fault

_EPILOG = """\
commands to a running simulator (each has its own --help):
  rtf simulator status                                  its state, and its faults
  rtf simulator inject KIND [TARGET] [NAME=VALUE ...]   inject a fault
  rtf simulator clear [NUMBER]                          clear this fault, or all faults
without a running simulator:
  rtf simulator faults [KIND] [--json]                  the kinds of faults

examples:
  rtf simulator --nameserver                            a whole robot, in real time
  rtf simulator --robot icubSim --parts head,left_arm --lockstep
  rtf simulator --model bench --realtime-factor inf
  rtf simulator --realtime-factor inf --cameras auto
  rtf simulator inject jam l_elbow torque=50 --delay 2 --duration 5

The first SIGINT or SIGTERM closes all ports, the second ends it at once.

exit codes:
  0 it ended because it was asked to   1 it was not started, or its time ended with an error   2 ended at once
  4 usage
"""
_FASTEST = float("inf")
_HIGHEST_RATE = 1000.0  # Hz: that of the simulated boards


def _reporting_errors(command: Callable[[Sequence[str]], int]) -> Callable[[Sequence[str]], int]:
    """Wrap a command so that it ends with 1, not with 4, when the simulator refuses or cannot be reached."""

    def run(words: Sequence[str]) -> int:
        try:
            return command(words)
        except RtfError as error:
            print(f"rtf simulator: {error}", file=sys.stderr)
            return int(ExitCode.FAILURES)

    return run


@_reporting_errors
def simulator(words: Sequence[str]) -> int:
    """Start a simulator and run it until a signal ends it; returns the exit code."""
    from rtf.bottle import Dialect
    from rtf.robot.model import load_robot
    from rtf.simulator.program import Settings, run_simulator

    parser = _parser()
    options = parser.parse_args(words)
    model = load_robot(options.model)
    if unknown := [part for part in options.parts if part not in model.served]:
        parser.error(f"argument --parts: there is no part {', '.join(unknown)!r}; there are {', '.join(model.served)}")
    if options.ball is not None and options.cameras == "no":
        parser.error("argument --ball: only cameras see it; add --cameras")
    if unknown := [part for part in options.drives if part not in model.parts]:
        parser.error(f"argument --drives: there is no part {', '.join(unknown)!r}; there are {', '.join(model.parts)}")
    return run_simulator(
        Settings(
            model=model,
            robot=options.robot or "",
            parts=options.parts,
            seed=options.seed,
            unit=options.unit,
            can=options.can,
            drives=options.drives,
            lockstep=options.lockstep,
            factor=options.realtime_factor,
            cameras=options.cameras,
            state_rate=options.state_rate,
            camera_rate=options.camera_rate,
            collision=options.collision,
            ball=options.ball,
            clock=options.clock,
            dialect=None if options.dialect is None else Dialect(options.dialect),
            nameserver=options.nameserver,
            allow=tuple(options.allow),
            allow_admin=tuple(options.allow_admin),
            ready_file=options.ready_file,
        )
    )


def _parser() -> Parser:
    from rtf.cli.network.options import add_access

    parser = Parser(
        prog="rtf simulator",
        usage="rtf simulator [options] | faults | status | inject | clear ...",
        description="Start a simulated robot: its ports are those of the robot, and /clock is its time.",
        epilog=_EPILOG,
    )
    parser.add_argument(
        "--model",
        metavar="ROBOT",
        default=DEFAULT_ROBOT,
        help=f"a robot of 'rtf robot list', or the path of a robot.toml (default: {DEFAULT_ROBOT})",
    )
    parser.add_argument("--robot", metavar="NAME", type=_robot, help="the beginning of its ports (default: MODELSim)")
    parser.add_argument("--parts", metavar="A,B", type=parts, default=(), help="the parts to serve (default: all)")
    parser.add_argument("--seed", metavar="N", type=count, default=0, help="where all that is random begins")
    parser.add_argument(
        "--unit", metavar="N", type=count, default=0, help="the robot of the population (default: 0, the nominal one)"
    )
    parser.add_argument("--can", action="store_true", help="with emulated boards on CAN buses, and drivers of these")
    parser.add_argument(
        "--drives",
        metavar="A,B",
        type=parts,
        default=(),
        help="with --can: the parts that have a board for each motor, which drives it; others have boards of joints",
    )
    pace = parser.add_mutually_exclusive_group()
    pace.add_argument("--lockstep", action="store_true", help="time passes only while all who take part wait for it")
    pace.add_argument(
        "--realtime-factor",
        metavar="F",
        type=_factor,
        default=1.0,
        help="how many times faster than the machine's clock time passes at most: 0.1 and more, or inf (default: 1)",
    )
    parser.add_argument("--clock", metavar="/PORT", type=_port, default="/clock", help="its clock (default: /clock)")
    parser.add_argument(
        "--cameras",
        nargs="?",
        choices=("auto", "yes", "no"),
        const="yes",
        default="no",
        help="with the eyes; auto: where pictures can be made",
    )
    for name, what, usual in (("state", "messages of each part", 100), ("camera", "pictures", 30)):
        parser.add_argument(
            f"--{name}-rate", metavar="HZ", type=_rate, help=f"{what} a second (default: {usual}, at most 1000)"
        )
    parser.add_argument(
        "--collision",
        choices=("capsules", "hulls", "none"),
        default="capsules",
        help="what can touch what: outlines, hulls of the covers, or nothing",
    )
    parser.add_argument(
        "--ball",
        metavar="X,Y,Z",
        type=_ball,
        help="with --cameras: where the red ball is, in m from the robot's root (default: as its robot.toml says)",
    )
    parser.add_argument("--dialect", choices=(3, 4), type=int, help="the major version of YARP to speak (default: 3)")
    parser.add_argument(
        "--nameserver", action="store_true", help="be the name server, too, at the place that the configuration says"
    )
    add_access(parser)
    parser.add_argument("--ready-file", metavar="FILE", type=Path, help="write a file when it is ready")
    return parser


def _add_robot(parser: Parser) -> None:
    parser.add_argument(
        "--robot", metavar="NAME", type=_robot, default="icubSim", help="the beginning of its ports (default: icubSim)"
    )


def _robot(text: str) -> str:
    name = text.strip("/")
    if not name or any(map(str.isspace, name)):
        raise argparse.ArgumentTypeError(f"{text!r} is no name of a robot; write one without blanks, such as icubSim")
    return name


def _port(text: str) -> str:
    from rtf.cli.network.options import own_name

    return own_name(text)


def _factor(text: str) -> float:
    from rtf.simulator.control_client import SLOWEST

    try:
        factor = float(text)
    except ValueError:
        factor = 0.0
    if not SLOWEST <= factor <= _FASTEST:
        raise argparse.ArgumentTypeError(f"{text!r} is no factor; write a number from {SLOWEST:g} on, or inf")
    return factor


def _ball(text: str) -> tuple[float, float, float]:
    from rtf.robot.errors import RefusedError
    from rtf.simulator.ball import place_of_ball

    try:
        return place_of_ball([float(word) for word in text.split(",")])
    except (ValueError, RefusedError) as error:
        raise argparse.ArgumentTypeError(f"{text!r}: {error}; write X,Y,Z such as -0.35,0,0.3") from None


def _rate(text: str) -> float:
    try:
        rate = float(text)
    except ValueError:
        rate = 0.0
    if not 0 < rate <= _HIGHEST_RATE:
        raise argparse.ArgumentTypeError(
            f"{text!r} is no rate; write a number of Hz above 0, {_HIGHEST_RATE:g} at most"
        )
    return rate


# What can be broken ----------------------------------------------------------------------------------------------


@_reporting_errors
def faults(words: Sequence[str]) -> int:
    """Print the kinds of faults, or all about one."""
    parser = Parser(prog="rtf simulator faults", description="The kinds of faults, by layer.")
    parser.add_argument("kind", nargs="?", metavar="KIND", help="this one only, with all there is to say of it")
    parser.add_argument("--json", action="store_true", help="for a program")
    options = parser.parse_args(words)
    from rtf.simulator.faults import KINDS, catalogue, find_kind

    kinds: list[type[Fault]] = list(KINDS.values()) if options.kind is None else [find_kind(options.kind)]
    if options.json:
        print(json.dumps([catalogue.facts(kind) for kind in kinds], indent=1))
    else:
        print(catalogue.as_text(kinds), end="")
    return int(ExitCode.PASSED)


# Talking to one that runs ----------------------------------------------------------------------------------------


@_reporting_errors
def status(words: Sequence[str]) -> int:
    """Print the state of a simulator."""
    parser = Parser(
        prog="rtf simulator status",
        description="Print the state of a simulator: time, participants, contacts and faults.",
    )
    _add_robot(parser)
    add_dialect(parser)
    options = parser.parse_args(words)
    from rtf.cli.network.options import make_network
    from rtf.simulator.control_client import SimulatorControl, describe_status

    with SimulatorControl(options.robot, network=make_network()) as control:
        print(describe_status(control.status()), end="")
    return int(ExitCode.PASSED)


@_reporting_errors
def inject(words: Sequence[str]) -> int:
    """Inject a fault into a simulator that runs."""
    parser = Parser(
        prog="rtf simulator inject",
        description="Inject a fault into a running simulator, and print its number, which is the argument of clear.",
        epilog="example:\n  rtf simulator inject encoder_drift l_elbow rate=0.5 --delay 2 --duration 10",
    )
    _add_robot(parser)
    add_dialect(parser)
    parser.add_argument("kind", metavar="KIND", help="one of 'rtf simulator faults'")
    parser.add_argument("words", nargs="*", metavar="TARGET | NAME=VALUE", help="what it strikes, and its parameters")
    parser.add_argument("--delay", metavar="S", type=seconds, default=0.0, help="it begins so much later")
    parser.add_argument("--duration", metavar="S", type=seconds, default=float("inf"), help="it ends by itself")
    options = parser.parse_intermixed_args(words)
    targets = [word for word in options.words if "=" not in word]
    if len(targets) > 1:
        parser.error(f"there is one target, {targets[0]}, and then {targets[1]!r}; parameters are NAME=VALUE")
    values = dict(_value(parser, word) for word in options.words if "=" in word)
    target = targets[0] if targets else ""
    from rtf.cli.network.options import make_network
    from rtf.simulator.control_client import SimulatorControl

    with SimulatorControl(options.robot, network=make_network()) as control:
        print(control.inject(options.kind, target, values, delay=options.delay, duration=options.duration))
    return int(ExitCode.PASSED)


def _value(parser: Parser, word: str) -> tuple[str, float]:
    name, text = key_value(word)
    try:
        return name, float(text)
    except ValueError:
        parser.error(f"{name}: {text!r} is no number")


@_reporting_errors
def clear(words: Sequence[str]) -> int:
    """Remove a fault, or all faults, from a simulator that runs."""
    parser = Parser(
        prog="rtf simulator clear",
        description="Clear faults of a running simulator, and print how many were cleared.",
    )
    _add_robot(parser)
    add_dialect(parser)
    parser.add_argument("number", nargs="?", type=count, metavar="NUMBER", help="of the fault (default: all)")
    options = parser.parse_args(words)
    from rtf.cli.network.options import make_network
    from rtf.simulator.control_client import SimulatorControl

    with SimulatorControl(options.robot, network=make_network()) as control:
        print(control.clear(options.number))
    return int(ExitCode.PASSED)
