"""``rtf red-ball``: the programs of the demonstration with the red ball."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.cli.parser import Parser, add_dialect, seconds
from rtf.robot.model.names import DEFAULT_ROBOT

if TYPE_CHECKING:
    from collections.abc import Sequence
    from contextlib import ExitStack

_TRACK_EPILOG = """\
ports, as those of pf3dTracker:
  NAME/video:i, NAME/right:i   pictures of the left and the right eye
  NAME/data:o                  x y z (m, in the frame of the left camera), likelihood, u v (px), 1.0 if it is seen
  NAME/video:o                 the left picture with the ball marked

examples:
  rtf red-ball track --robot icubSim
  rtf read ... /pf3dTracker/data:o
"""

_DEMO_EPILOG = """\
what it needs:
  the robot with its eyes, its Cartesian controllers (/ROBOT/cartesianController/left_arm ...), a gaze controller,
  and the tracker: rtf red-ball track

requests of NAME/rpc:
  start [AZI ELE VER]      look at azimuth, elevation, vergence (deg), then follow the ball
  stop                     stop, and go home
  update_pose DX DY DZ     put the ball of a simulator at an offset (m) from its first place
  status                   what it does, why, and where the ball is

examples:
  rtf robotinterface --config icubSim/redBall.xml
  rtf red-ball track
  rtf red-ball demo
  rtf rpc /demoRedBall/rpc start 0 -50 10
"""


def track(words: Sequence[str]) -> int:
    """Track the ball until a signal; returns the exit code."""
    parser = Parser(
        prog="rtf red-ball track",
        description="Find the red ball in the pictures of a robot's eyes, and send where it is.",
        epilog=_TRACK_EPILOG,
    )
    _add_robot(parser)
    parser.add_argument("--name", metavar="/PORT", default="/pf3dTracker", help="its ports (default: /pf3dTracker)")
    parser.add_argument("--radius", metavar="M", type=float, default=0.035, help="of the ball (default: 0.035)")
    parser.add_argument(
        "--field-of-view", metavar="DEG", type=float, default=0.0, help="vertical (default: the left camera is asked)"
    )
    parser.add_argument("--one-eye", action="store_true", help="the left eye alone: the distance is that by the size")
    options = parser.parse_args(words)
    from rtf.cli.network.options import make_network
    from rtf.red_ball.program import TrackerSettings, start_tracker
    from rtf.robot.interface.network_program import run_program, say, use_clock
    from rtf.robot.model import load_robot

    use_clock(options.clock)
    network = make_network()
    network.report = say
    settings = TrackerSettings(
        load_robot(options.model),
        options.robot,
        options.name,
        options.radius,
        options.field_of_view,
        one_eye=options.one_eye,
        patience=options.patience,
    )

    def start(opened: ExitStack) -> None:
        start_tracker(settings, network, opened)

    return run_program(options.name, start)


def demo(words: Sequence[str]) -> int:
    """Run the demonstration until a signal; returns the exit code."""
    parser = Parser(
        prog="rtf red-ball demo",
        description="Have a robot look at the red ball and reach for it, when it is asked to.",
        epilog=_DEMO_EPILOG,
    )
    _add_robot(parser)
    parser.add_argument("--name", metavar="/PORT", default="/demoRedBall", help="its ports (default: /demoRedBall)")
    parser.add_argument("--gaze", metavar="/PORT", default="/iKinGazeCtrl", help="the gaze controller (/iKinGazeCtrl)")
    parser.add_argument(
        "--tracker", metavar="/PORT", default="/pf3dTracker", help="the tracker (/pf3dTracker); '': others connect it"
    )
    parser.add_argument("--hands", choices=("left", "right", "both"), default="both", help="which hands reach")
    options = parser.parse_args(words)
    from rtf.cli.network.options import make_network
    from rtf.red_ball.demo import DemoSettings
    from rtf.red_ball.program import start_demo
    from rtf.robot.interface.network_program import run_program, say, use_clock
    from rtf.robot.model import load_robot

    use_clock(options.clock)
    network = make_network()
    network.report = say
    settings = DemoSettings(
        load_robot(options.model),
        options.robot,
        options.name,
        options.tracker,
        options.gaze,
        ("left", "right") if options.hands == "both" else (options.hands,),
        patience=options.patience,
    )
    return run_program(options.name, lambda opened: start_demo(settings, network, opened))


def _add_robot(parser: Parser) -> None:
    parser.add_argument("--robot", metavar="NAME", default="icubSim", help="the beginning of its ports (icubSim)")
    parser.add_argument(
        "--model",
        metavar="ROBOT",
        default=DEFAULT_ROBOT,
        help=f"a robot of 'rtf robot list', or the path of a robot.toml (default: {DEFAULT_ROBOT})",
    )
    parser.add_argument(
        "--patience", metavar="S", type=seconds, default=20.0, help="how long it waits for the robot (default: 20)"
    )
    parser.add_argument(
        "--clock",
        metavar="/PORT",
        default="",
        help="the robot's clock: /clock, or lockstep:/clock (default: RTF_CLOCK)",
    )
    add_dialect(parser)
