"""``rtf gaze``: the gaze controller of a robot in the network, as a program with the settings of iKinGazeCtrl."""

from __future__ import annotations

import os
import threading
from typing import TYPE_CHECKING

from rtf.bottle import Property, as_string, to_string
from rtf.cli.parser import Parser, add_dialect
from rtf.resources import ResourceFinder
from rtf.robot.model.names import DEFAULT_ROBOT
from rtf.robot_testing.robot_name import ROBOT_VARIABLE
from rtf.testing.plugins import shipped_folder

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator, Sequence
    from contextlib import ExitStack

    from rtf.middleware.ports.network import Network
    from rtf.robot.device import Device

_EPILOG = """\
It has the ports of the iCub's iKinGazeCtrl, so its clients work with it:
  NAME/rpc                                    requests, in the words of the original
  NAME/xd:i, angles:i, mono:i, stereo:i       streamed targets
  NAME/x:o, angles:o, q:o, events:o           where the eyes look, the joints, and when motions begin and end
Neck and eyes are moved through the board /ROBOT/head, and the positions of the torso come from /ROBOT/torso.
The vestibulo-ocular reflex needs a gyroscope: /ROBOT/head/inertials, or that of the robot's table (/ROBOT/inertial).

The settings are those of the original's config.ini, in a file or as options: --KEY VALUE, or --GROUP::KEY VALUE:
  name, robot, head, torso (off: it stands still), head_version, saccades, vor, ocr
  trajectory_time::neck, ::eyes; eye_tilt::min, ::max; imu::mode, ::source_port_name, ::timeout, ::gyro_noise_threshold
  cameras::context, ::file, or the groups themselves: CAMERA_CALIBRATION_LEFT, _RIGHT, ALIGN_KIN_LEFT, _RIGHT
  ping_robot_tmo, how long it waits for the robot; of this project: period (ms), eye_joints, eyes_lag (s)
Other settings of a file, and of the original, are reported and not used.

examples:
  rtf simulator &                                     # a robot without a controller
  rtf gaze --robot icubSim --from configSim.ini       # the settings for this robot, which come with this project
  rtf rpc /iKinGazeCtrl/rpc
  > look mono (left 100 80 1.0)                       # what the left eye sees at this pixel, 1 m in front of it
  > get done
  rtf gaze --robot icub --head_version v2.5 --saccades off
"""
_CONTEXT, _FILE = "iKinGazeCtrl", "config.ini"
_PATIENCE = 40.0  # s, as the original
_CAMERAS = ("CAMERA_CALIBRATION_LEFT", "CAMERA_CALIBRATION_RIGHT", "ALIGN_KIN_LEFT", "ALIGN_KIN_RIGHT")
#: What is used of the settings; the keys of groups, empty: all of them.
_USED: dict[str, frozenset[str]] = {
    **dict.fromkeys(("name", "robot", "head", "torso", "head_version", "saccades", "vor", "ocr"), frozenset()),
    **dict.fromkeys(("ping_robot_tmo", "period", "eye_joints", "eyes_lag", "Robot", "from", *_CAMERAS), frozenset()),
    "trajectory_time": frozenset({"neck", "eyes"}),
    "eye_tilt": frozenset({"min", "max"}),
    "imu": frozenset({"mode", "source_port_name", "timeout", "gyro_noise_threshold"}),
    "cameras": frozenset({"context", "file"}),
}
#: Further settings of the original, which are reported, and not used.
_ORIGINAL = ("neck_position_control", "min_abs_vel", "verbose", "verbosity", "tweak", "debugInfo")
#: The greatest age (s) of what a gyroscope says.
_FRESH = 0.04


def gaze(words: Sequence[str]) -> int:
    """Run a gaze controller until a signal; returns the exit code."""
    parser = _parser()
    options, others = parser.parse_known_args(words)
    for word in others:
        key = word.removeprefix("--").partition("::")[0]
        if word.startswith("-") and not word[1:2].isdigit() and key not in (*_USED, *_ORIGINAL):
            parser.error(f"unrecognized arguments: {word}")
    settings = _settings(options, others)
    robot, name = (as_string(settings.find(key)).strip("/") for key in ("robot", "name"))
    settings.put("name", f"/{name}")
    settings.put("Robot", options.model)

    from rtf import clock
    from rtf.cli.network.options import make_network
    from rtf.middleware.clocks.network_clock import clock_from_environment
    from rtf.robot import parameters
    from rtf.robot.device import make_device
    from rtf.robot.gaze.device import GazeControllerDevice
    from rtf.robot.interface.network_program import await_ports, run_program, say, use_clock

    use_clock(options.clock)
    end = threading.Event()

    def start(opened: ExitStack) -> None:
        network = make_network()
        network.report = say
        for sentence in _not_used(settings):
            say(sentence)
        device = make_device("gazecontrollerserver", settings, network=network)
        assert isinstance(device, GazeControllerDevice)
        device.quit_program = end.set
        parts = [as_string(settings.get(part, part)) for part in ("head", "torso")]
        boards = [f"/{robot}/{part}" for part in parts if part != "off"]
        await_ports(
            [f"{board}/state:o" for board in boards],
            network,
            parameters.positive(settings, "ping_robot_tmo", _PATIENCE),
            end,
        )
        opened.enter_context(clock.use(clock_from_environment(network)))
        devices = _devices(settings, robot, boards, network, opened)
        opened.callback(device.close)  # before the boards: it ends a motion
        device.attach(devices)

    return run_program(f"/{name}", start, end)


def _parser() -> Parser:
    parser = Parser(
        prog="rtf gaze",
        usage="rtf gaze [--robot NAME] [--from FILE] [--KEY VALUE ...]",
        description="Turn neck and eyes of a robot in the network until both eyes look at a point.",
        epilog=_EPILOG,
    )
    robot = os.environ.get(ROBOT_VARIABLE) or "icub"
    parser.add_argument("--robot", metavar="NAME", help=f"the beginning of its ports (default: {robot})")
    parser.add_argument("--name", metavar="/PORT", help="the controller's own ports (default: /iKinGazeCtrl)")
    parser.add_argument("--context", metavar="C", default=_CONTEXT, help=f"where FILE is (default: {_CONTEXT})")
    parser.add_argument("--from", metavar="FILE", dest="file", help=f"its settings (default: {_FILE}, if it is there)")
    parser.add_argument(
        "--model",
        metavar="ROBOT",
        default=DEFAULT_ROBOT,
        help=f"a robot of 'rtf robot list', or the path of a robot.toml (default: {DEFAULT_ROBOT})",
    )
    parser.add_argument(
        "--clock",
        metavar="/PORT",
        default="",
        help="the robot's clock: /clock, or lockstep:/clock (default: RTF_CLOCK)",
    )
    add_dialect(parser)
    return parser


def _settings(options: argparse.Namespace, others: Sequence[str]) -> Property:
    """Return the settings: of the command line, else of the file, with the cameras of theirs."""
    finder = ResourceFinder(contexts=[options.context], roots=[shipped_folder("suites") / "robots"])
    finder.configure([*(["--from", options.file] if options.file else []), *others], default_file=_FILE)
    settings = finder.properties
    for key, given, default in (
        ("robot", options.robot, os.environ.get(ROBOT_VARIABLE) or "icub"),
        ("name", options.name, "iKinGazeCtrl"),
    ):
        settings.put(key, given or as_string(settings.get(key, default)))
    cameras = Property.from_bottle(settings.find_group("cameras") or Property().to_bottle())
    if cameras.check("file"):
        context = as_string(cameras.get("context", options.context))
        where = ResourceFinder(contexts=[context], roots=[shipped_folder("suites") / "robots"])
        where.configure(["--from", as_string(cameras.find("file"))])
        for key in _CAMERAS:
            group = where.properties.find_group(key)
            if group is not None and not settings.check(key):
                settings.put_group(group, key=key, location=where.properties.location(key))
    return settings


def _not_used(settings: Property) -> Iterator[str]:
    """Yield a sentence for each setting that has no effect here."""
    for key, group in settings.items():
        unknown = [(key, settings.location(key))] if key not in _USED else []
        if _USED.get(key):
            inner = Property.from_bottle(group)
            unknown = [(f"{key}::{one}", settings.location(key, one)) for one in inner if one not in (key, *_USED[key])]
        for name, location in unknown:
            yield f"{f'{location}: ' if location else ''}{name} is not used: this controller has no such setting"


def _devices(
    settings: Property, robot: str, boards: Sequence[str], network: Network, opened: ExitStack
) -> dict[str, Device]:
    """Connect to the boards and the gyroscope. Raises RobotError."""
    from rtf.robot.boards.client import connect

    devices: dict[str, Device] = {
        board: opened.enter_context(connect(board, carrier="tcp", network=network, strict=True)) for board in boards
    }
    source = _gyroscope(settings, robot, network)
    if source:
        from rtf.robot.sensors.analog_sensors import AnalogSensorsClient

        sensors = AnalogSensorsClient(source, network=network)
        opened.callback(sensors.close)
        timeout = Property.from_bottle(settings.find_group("imu") or Property().to_bottle()).get("timeout", _FRESH)
        sensors.open(Property({"remote": source, "carrier": "tcp", "timeout": timeout}))
        devices[source] = sensors
    return devices


def _gyroscope(settings: Property, robot: str, network: Network) -> str:
    """Return the beginning of the ports of the gyroscope, or an empty text. Raises RobotError if it is not there."""
    from rtf.middleware.ports.remote import exists
    from rtf.middleware.wire.contact import Contact
    from rtf.robot import parameters
    from rtf.robot.errors import DeviceError
    from rtf.robot.model import load_robot

    imu = parameters.group_of(settings, "imu")
    if not parameters.flag(imu, "mode", default=True):
        return ""
    named = as_string(imu.get("source_port_name", ""))
    tables = load_robot(to_string(settings.find("Robot"))).sensors.inertial.values()
    places = [named] if named else [f"/{robot}/head/inertials", *(f"/{robot}/{table.port}" for table in tables)]
    found = next((place for place in places if exists(network, Contact(f"{place}/measures:o"))), "")
    if named and not found:
        raise DeviceError(f"there is no {named}/measures:o; start it, or give another, or --imu::mode off")
    if not found:
        network.report(f"no gyroscope: there is no {' or '.join(places)}; the torso's encoders take its place")
    return found
