"""``rtf cartesian``: the Cartesian controller of a robot in the network, and the solver, as programs."""

from __future__ import annotations

import os
import threading
from contextlib import ExitStack, closing
from typing import TYPE_CHECKING, NamedTuple

from rtf.bottle import Bottle, Property, as_list, as_string
from rtf.cli.parser import Parser, add_dialect
from rtf.errors import RtfError
from rtf.resources import ResourceFinder
from rtf.robot.model.names import DEFAULT_ROBOT
from rtf.robot_testing.robot_name import ROBOT_VARIABLE
from rtf.testing.plugins import shipped_folder

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Sequence

    from rtf.middleware.ports.network import Network
    from rtf.robot.device import Device
    from rtf.robot.kinematics import Chain

_CONTROL_EPILOG = """\
It has the ports of the iCub's cartesiancontrollerserver, so its clients work with it:
  NAME/rpc:i, NAME/command:i   requests, and streamed targets
  NAME/state:o, NAME/events:o  the pose of the hand, and when motions begin and end
The joints are moved by direct positions through the boards /ROBOT/PART of the network. Joints of other parts than LIMB,
such as those of the torso, stand still until a client switches them on ("set dof").

examples:
  rtf simulator &                                     # a robot without a controller
  rtf cartesian control left_arm --robot icubSim --drawn "(5 (0 0 -1) (0 0 1))"
  rtf rpc /icubSim/cartesianController/left_arm/rpc:i
  > go xyz 1.5 (-0.3 -0.15 0.1)                       # in 1.5 s, metres in the frame of the waist
  > get done
  > stop
  rtf cartesian solver left_arm --robot icubSim &     # with a solver that is a program of its own
  rtf cartesian control left_arm --robot icubSim --solver cartesianSolver/left_arm
"""
_SOLVER_EPILOG = """\
It has the ports of the iCub's iKinCartesianSolver, so the iCub's controller works with it:
  NAME/in    targets: ([xd] (3 or 7 numbers)) ([pose] [full]|[xyz]) ([mode] [shot]|[cont]) ([tok] number)
  NAME/out   answers: ([xd] (7)) ([x] (7)) ([q] (joints in deg)) ([tok] number)
  NAME/rpc   settings, questions and state: "help" has the words
Where the joints are, it reads from the boards /ROBOT/PART; it moves nothing.

The command line of the original is taken, too: --part LIMB, and with --context or --from the group LIMB of a file
(default: cartesianSolver.ini), of which name, robot, type, dof, rest_pos, rest_weights, pose, mode, drawn and together
are used.

examples:
  rtf cartesian solver --context cartesianSolver --part left_arm
  rtf cartesian solver left_arm --robot icubSim --drawn "(5 (0 0 -1) (0 0 1))"
  rtf rpc /cartesianSolver/left_arm/rpc
  > ask (xd (-0.3 -0.15 0.1)) (pose xyz)              # the posture; nothing moves
  > stat
"""


class CommandError(RtfError, ValueError):
    """A command line that does not fit the files that it names."""


class _Limb(NamedTuple):
    """A chain, which of its joints belong to the part of its name, and the boards that have them."""

    chain: Chain
    own: list[bool]
    parts: list[str]


def control(words: Sequence[str]) -> int:
    """Run a controller until a signal; returns the exit code."""
    parser = _parser("control", "Move the hand, or the foot, of a robot in the network in space.", _CONTROL_EPILOG)
    parser.add_argument(
        "--name", metavar="/PORT", default="", help="its ports (default: /ROBOT/cartesianController/LIMB)"
    )
    parser.add_argument(
        "--solver", metavar="/PORT", default="", help="the ports of a solver that is a program (default: its own)"
    )
    parser.add_argument("--period", metavar="S", type=float, default=0.01, help="of the control (default: 0.01)")
    options = parser.parse_args(words)
    name = options.name or f"/{options.robot.strip('/')}/cartesianController/{options.limb}"

    def start(network: Network, opened: ExitStack) -> None:
        from rtf.robot.device import make_device

        limb = _limb(options)
        side, _, part = options.limb.rpartition("_")
        names = {
            "ControllerName": name.strip("/"),
            "ControllerPeriod": 1e3 * options.period,
            "KinematicPart": part,
            "KinematicType": f"{side}_v{options.version}",
            "Robot": options.model,
            "Inactive": Bottle([joint for joint, own in zip(limb.chain.joints, limb.own, strict=True) if not own]),
            "SolverNameToConnect": options.solver.strip("/"),
        }
        general = Bottle(["GENERAL", *(Bottle([key, value]) for key, value in names.items()), *_lists(options)])
        device = make_device("cartesiancontrollerserver", Property.from_bottle(Bottle([general])), network=network)
        boards = _boards(options.robot, limb.parts, network, opened)
        opened.callback(device.close)  # before the boards: it ends a motion
        device.attach(boards)

    return _run(name, start)


def solver(words: Sequence[str]) -> int:
    """Run a solver until a signal, or until it is asked to quit; returns the exit code."""
    parser = _parser("solver", "Find the postures for targets of a Cartesian controller.", _SOLVER_EPILOG)
    parser.add_argument("--name", metavar="/PORT", default="", help="its ports (default: /cartesianSolver/LIMB)")
    parser.add_argument("--part", metavar="LIMB", default="", help="the same as LIMB")
    parser.add_argument("--context", metavar="C", default="", help="where the file is looked for, as YARP does")
    parser.add_argument("--from", metavar="FILE", default="", dest="file", help="the file (cartesianSolver.ini)")
    options = parser.parse_args(words)
    options.limb = options.limb or options.part
    if not options.limb:
        parser.error("which LIMB? such as left_arm")
    settings = _settings(words, options)
    name = f"/{(options.name or f'cartesianSolver/{options.limb}').strip('/')}"
    end = threading.Event()

    def start(network: Network, opened: ExitStack) -> None:
        from rtf.robot.cartesian.device import read_preference
        from rtf.robot.cartesian.solver import SOLVER_TABLE, CartesianSolver, SolverPorts
        from rtf.robot.parameters import names as names_in

        limb = _limb(options)
        given = Property.from_bottle(Bottle(_lists(options)))
        board = _chain_board(limb, _boards(options.robot, limb.parts, network, opened), network)

        def make(answer: Callable[[Bottle], object]) -> CartesianSolver:
            return CartesianSolver(
                board,
                limb.chain,
                active=_active(settings, limb),
                together=names_in(given, "Together"),
                drawn=read_preference(given, limb.chain),
                answer=answer,
                quits=end.set,
                report=network.report,
            )

        ports = opened.enter_context(closing(SolverPorts(name, make, network)))
        for key, request in (("rest_pos", "resp"), ("rest_weights", "resw"), ("pose", "pose"), ("mode", "mode")):
            if settings.check(key):
                SOLVER_TABLE.answer(ports.solver, Bottle(["set", request, settings.find(key)]))

    return _run(name, start, end)


def _parser(name: str, description: str, epilog: str) -> Parser:
    parser = Parser(prog=f"rtf cartesian {name}", description=description, epilog=epilog)
    parser.add_argument(
        "limb",
        metavar="LIMB",
        nargs="?" if name == "solver" else None,
        default="",
        help="a chain of the robot's tables, such as left_arm or right_leg",
    )
    robot = os.environ.get(ROBOT_VARIABLE) or "icub"
    parser.add_argument("--robot", metavar="NAME", default=robot, help=f"the beginning of its ports (default: {robot})")
    parser.add_argument(
        "--model",
        metavar="ROBOT",
        default=DEFAULT_ROBOT,
        help=f"a robot of 'rtf robot list', or the path of a robot.toml (default: {DEFAULT_ROBOT})",
    )
    parser.add_argument("--version", metavar="V", default="2.5", help="of the chain in its tables (default: 2.5)")
    parser.add_argument(
        "--together", metavar="(A B)", default="", help="joints that are only switched together, such as a shoulder's"
    )
    parser.add_argument(
        "--drawn",
        metavar="(LINK (X Y Z) (W W W))",
        default="",
        help="a link that is drawn to a place, such as an elbow",
    )
    add_dialect(parser)
    return parser


def _settings(words: Sequence[str], options: argparse.Namespace) -> Property:
    """Return the group of the limb in a file, if one is named, and take its name, robot and type as options."""
    if not (options.context or options.file):
        return Property()
    finder = ResourceFinder(roots=[shipped_folder("suites") / "robots"])
    finder.configure(words, default_file="cartesianSolver.ini")
    group = finder.properties.find_group(options.limb)
    if group is None:
        raise CommandError(f"{options.file or 'cartesianSolver.ini'} has no group [{options.limb}]")
    settings = Property.from_bottle(group)
    options.name = options.name or as_string(settings.get("name", ""))
    options.robot = as_string(settings.get("robot", options.robot))
    for key in ("drawn", "together"):
        if settings.check(key) and not getattr(options, key):
            setattr(options, key, Bottle([settings.get(key, "")]).to_text())
    if settings.check("type"):
        _, _, version = as_string(settings.find("type")).partition("_v")
        options.version = version if "." in version else f"{version or 1}.0"
    return settings


def _active(settings: Property, limb: _Limb) -> list[bool]:
    """Return which joints take part: ``dof`` of the settings, else those of the limb's own part."""
    given = as_list(settings.find("dof")) if settings.check("dof") else None
    chosen = list(limb.own)
    for place, value in enumerate((given or [])[: len(chosen)]):
        if value in (0, 1):
            chosen[place] = bool(value)
    return chosen


def _lists(options: argparse.Namespace) -> list[Bottle]:
    pairs = (("Together", options.together), ("Drawn", options.drawn))
    return [Bottle([key, *Bottle.parse(text)]) for key, text in pairs if text]


def _limb(options: argparse.Namespace) -> _Limb:
    """Return the limb. Raises RobotModelError, and RefusedError for one that the robot does not have."""
    from rtf.robot.kinematics import robot_chains
    from rtf.robot.model import load_robot

    robot = load_robot(options.model)
    chain = robot_chains(robot).chain(options.limb, options.version).limited_by(robot.axes)
    parts = [robot.axis(joint).part for joint in chain.joints]
    return _Limb(chain, [part == options.limb for part in parts], list(dict.fromkeys(parts)))


def _boards(robot: str, parts: Sequence[str], network: Network, opened: ExitStack) -> dict[str, Device]:
    """Connect to the boards of the parts. Raises RobotError."""
    from rtf.robot.boards.client import connect

    return {
        part: opened.enter_context(connect(f"/{robot.strip('/')}/{part}", carrier="tcp", network=network, strict=True))
        for part in parts
    }


def _chain_board(limb: _Limb, boards: dict[str, Device], network: Network) -> Device:
    """Return one board of the joints of the chain, in its order. Raises DeviceError."""
    from rtf.robot.devices.remapper import ControlBoardRemapper

    board = ControlBoardRemapper("the chain", network=network)
    board.open(Property({"axesNames": Bottle(list(limb.chain.joints))}))
    board.attach(boards)
    return board


def _run(name: str, start: Callable[[Network, ExitStack], None], end: threading.Event | None = None) -> int:
    """Run a program in the time of the robot; see run_program."""
    from rtf import clock
    from rtf.cli.network.options import make_network
    from rtf.middleware.clocks.network_clock import clock_from_environment
    from rtf.robot.interface.network_program import run_program, say

    def begin(opened: ExitStack) -> None:
        network = make_network()
        network.report = say
        opened.enter_context(clock.use(clock_from_environment(network)))
        start(network, opened)

    return run_program(name, begin, end)
