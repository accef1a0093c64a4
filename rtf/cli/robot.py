"""``rtf robot``: the robots that can be tested, one of them in full, and a draft for a new one."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.cli.parser import Parser
from rtf.errors import RtfError
from rtf.robot.model.names import FILE
from rtf.testing.plugins import shipped_folder
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.robot.model import RobotModel
    from rtf.simulator.plant import Plant

_PICTURE = (640, 480)


def _reporting_errors(command: Callable[[Sequence[str]], int]) -> Callable[[Sequence[str]], int]:
    """Wrap a command so that it ends with 1 and a sentence when a robot cannot be read."""

    def run(words: Sequence[str]) -> int:
        try:
            return command(words)
        except RtfError as error:
            print(f"rtf robot: {error}", file=sys.stderr)
            return int(ExitCode.FAILURES)

    return run


@_reporting_errors
def list_robots(words: Sequence[str]) -> int:
    """List the robots that can be found, a line each."""
    from rtf.robot.model import find_robot, load_robot, robot_names

    parser = Parser(prog="rtf robot list", description="The robots in ./robots, in the user's folder, and shipped.")
    parser.parse_args(words)
    for name in robot_names():
        try:
            robot = load_robot(name)
        except RtfError as error:
            print(f"{name:<12} cannot be read: {str(error).splitlines()[0]}")
            continue
        parts = ", ".join(f"{part.name} {len(part.axes)}" for part in robot.parts.values())
        print(
            f"{name:<12} {len(robot.axes):>3} joints ({parts}), thresholds {robot.profile}, {find_robot(name).parent}"
        )
    return int(ExitCode.PASSED)


@_reporting_errors
def check_robot(words: Sequence[str]) -> int:
    """Read a robot, build it, and report what is wrong or assumed; 1 if a robot like this could not be tested."""
    from rtf.robot.kinematics.tables import CHAINS_FILE, robot_chains
    from rtf.robot.model import load_robot
    from rtf.robot_testing.thresholds import wrong_thresholds
    from rtf.simulator.plant import Options, build
    from rtf.simulator.poses import problems_of
    from rtf.simulator.skin import covered_shape

    parser = Parser(prog="rtf robot check", description="Look at a robot: its joints, its drives, what was assumed.")
    parser.add_argument("robot", metavar="ROBOT", help=f"its name, or the path of its {FILE}")
    parser.add_argument(
        "--picture", metavar="FILE.png", type=Path, help="draw it in its home pose, its safe ones, and its workspace"
    )
    options = parser.parse_args(words)
    robot = load_robot(options.robot)
    plant = build(robot, Options(cameras=options.picture is not None, workspace=True))
    data = plant.data()
    gravity = plant.axis_torques(data.qfrc_bias).tolist()
    _print_joints(robot, gravity)
    _print_coverage(robot, _suites(robot)[0])
    for name, patch in robot.sensors.skin.items():
        covered_shape(name, patch, plant)
    if (robot.folder / CHAINS_FILE).is_file():
        tables = robot_chains(robot)
        chains = (f"{name} ({', '.join(tables.versions(name))})" for name in tables.names)
        print(f"tables of chains: {', '.join(chains)}")
    problems = [*problems_of(plant), *wrong_thresholds(robot)]
    for sentence in robot.assumed:
        print(f"assumed: {sentence}")
    for problem in problems:
        print(f"problem: {problem}")
    if options.picture is not None:
        _draw(plant, options.picture)
        print(f"picture: {options.picture}")
    state = f"{len(robot.assumed)} assumptions, thresholds {robot.profile}"
    print(f"{'NOT IN ORDER' if problems else 'IN ORDER'}  {robot.name}: {len(robot.axes)} joints, {state}")
    return int(ExitCode.FAILURES if problems else ExitCode.PASSED)


def _print_joints(robot: RobotModel, gravity: Sequence[float]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("part", "joint", "limits", "home", "speed", "torque", "gravity", "gear", title=robot.title)
    for axis, load in zip(robot.axes, gravity, strict=True):
        unit, force = axis.unit, "N" if axis.prismatic else "Nm"
        table.add_row(
            axis.part,
            axis.name,
            f"{axis.minimum:g} to {axis.maximum:g} {unit}",
            f"{axis.home:g}",
            f"{axis.max_velocity:.4g} {unit}/s",
            f"{axis.max_torque:g} {force}",
            f"{load:.2f}",
            f"{axis.gearbox:g}",
        )
    Console(width=110, highlight=False).print(table)


def _draw(plant: Plant, path: Path) -> None:
    """Draw the robot in its home pose and in the safe ones, with its workspace."""
    from PIL import Image, ImageDraw, ImageFont

    from rtf.simulator.cameras import Camera
    from rtf.simulator.poses import poses, standing
    from rtf.simulator.scene import OUTSIDE

    with Camera(plant.model, OUTSIDE, *_PICTURE) as camera:
        pictures = {name: Image.fromarray(camera.render(standing(plant, axes))) for name, axes in poses(plant).items()}
    width, height = _PICTURE
    whole = Image.new("RGB", (width * len(pictures), height))
    for place, (name, picture) in enumerate(pictures.items()):
        if len(pictures) > 1:
            ImageDraw.Draw(picture).text((12, 8), name, fill="black", font=ImageFont.load_default(24))
        whole.paste(picture, (width * place, 0))
    whole.save(path)


@_reporting_errors
def new_robot(words: Sequence[str]) -> int:
    """Write a draft of a robot.toml from a description."""
    from rtf.simulator.derive import draft

    parser = Parser(
        prog="rtf robot new",
        description="Write robots/NAME/robot.toml with all that can be derived, and a list of what had to be assumed.",
    )
    parser.add_argument("description", metavar="FILE.urdf|.xml", type=Path, help="its description, URDF or MJCF")
    parser.add_argument("--name", help="the robot's name (default: that of the file)")
    parser.add_argument(
        "--folder", type=Path, default=Path("robots"), help="where to make its folder (default: robots)"
    )
    parser.add_argument(
        "--package", default="", help="the installed distribution that has the file; its path is not written then"
    )
    options = parser.parse_args(words)
    description: Path = options.description.resolve()
    if not description.is_file():
        parser.error(f"there is no file {options.description}")
    name = options.name or re.sub(r"\W+", "_", options.description.stem)
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        parser.error(f"argument --name: {name!r} is no name; write letters, digits and underscores")
    path: Path = options.folder / name / FILE
    if path.exists():
        parser.error(f"{path} exists; use --name or --folder, or delete it")
    made = draft(name, description, _source(description, options.package, path))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(made.text, encoding="utf-8")
    print(f"{path}: {made.joints} joints; assumed, and to be looked at:")
    for sentence in made.assumed:
        print(f"  {sentence}")
    print(f"next: rtf robot check {path.parent}/ --picture {name}.png, then: rtf robot test {path.parent}/")
    return int(ExitCode.PASSED)


@_reporting_errors
def test_robot(words: Sequence[str]) -> int:
    """Run the suites of ``suites/any`` for which a simulated robot has the parts."""
    from rtf.cli import testrunner
    from rtf.cli.arguments import parse_run
    from rtf.robot.model import load_robot
    from rtf.robot_testing.thresholds import wrong_thresholds

    parser = Parser(
        prog="rtf robot test",
        usage="rtf robot test ROBOT [options of testrunner]",
        description="Test a simulated robot with all tests that need no more than its model; see testrunner --help.",
    )
    parser.add_argument("robot", metavar="ROBOT", help=f"its name, or the path of its {FILE}")
    options, rest = parser.parse_known_args(words)
    parse_run(rest)
    robot = load_robot(options.robot)
    if problems := wrong_thresholds(robot):
        print("\n".join(f"rtf robot: {problem}" for problem in problems), file=sys.stderr)
        return int(ExitCode.USAGE)
    suites, obstacles = _suites(robot)
    print(f"{robot.title}: {len(robot.axes)} joints in {len(robot.parts)} parts, thresholds {robot.profile}")
    for name, why in obstacles.items():
        print(f"not tested: {name}, {why}")
    words = [*suites, *rest]
    _print_coverage(robot, words)
    return int(testrunner.main(words))


def _suites(robot: RobotModel) -> tuple[list[str], dict[str, str]]:
    """Return the words of testrunner for the suites of a robot, and why others cannot be run, by their names."""
    torque = [part.name for part in robot.parts.values() if any(axis.torque_control for axis in part.axes)]
    sensors = robot.sensors
    absent = "which the robot does not have"
    obstacles = {
        "joints": "",
        "torque": "" if torque else absent,
        "sensors": "" if sensors.force_torque or sensors.inertial or sensors.angles else absent,
        "force-torque": "" if sensors.force_torque else absent,
        "skin": "" if sensors.skin else absent,
        "depth-cameras": _obstacle_to_rendering() if sensors.depth_cameras else absent,
        "battery": "" if sensors.battery is not None else absent,
    }
    folder = shipped_folder("suites") / "any"
    suites = [
        word
        for name, why in obstacles.items()
        if not why
        for word in ("--suite", str(folder / f"simulated-{name}.xml"))
    ]
    defined = {"model": str(robot.file), "parts": " ".join(robot.parts), "torque_parts": " ".join(torque)}
    defined["seed"] = defined["unit"] = "0"  # a later --define counts
    needed = ["model", "seed", "unit", "parts", *(["torque_parts"] if torque else [])]
    defines = [word for name in needed for word in ("--define", f"{name}={defined[name]}")]
    return [*suites, *defines], {name: why for name, why in obstacles.items() if why}


def _print_coverage(robot: RobotModel, words: Sequence[str]) -> None:
    """Print which joints the tests judge that these words of testrunner choose."""
    from rtf.cli.arguments import parse_run
    from rtf.cli.coverage_table import print_coverage
    from rtf.cli.planning import make_plan
    from rtf.robot_testing.coverage import coverage

    options = parse_run(words)
    options.list = True  # without the fixtures that tests imply
    print_coverage(robot, coverage(robot, make_plan(options), options.overrides))


def _obstacle_to_rendering() -> str:
    """Return why no image can be made on this machine; an empty string if it can."""
    from rtf.simulator.errors import RenderingError
    from rtf.simulator.rendering import rendering_back_end

    try:
        rendering_back_end()
    except RenderingError as error:
        return f"as {error}"
    return ""


def _source(description: Path, package: str, path: Path) -> str:
    """Return the table [description] of a new file."""
    import os

    if package:
        return f'package = "{package}"\nfile = "/{"/".join(description.parts[-3:])}"'
    relative = os.path.relpath(description, path.parent.resolve())
    return f'file = "{relative}"'
