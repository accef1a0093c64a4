"""``rtf demo``: show what the framework does, and say whether all of it ended as it was meant to.

First the demonstration suite, which crashes, hangs and fails on purpose, so that its own exit code is that of a run
with failures; what is judged is whether the framework saw exactly what happened. Then two programs that talk, an
application of five programs on two nodes, a simulated robot that moves, a test that names a broken board on a CAN bus,
and the battery: all tests of a lab on the simulated iCub, with the live page. Unless a dialect is set, the battery runs
on robots of YARP 3, and a share of it on one of YARP 4; another share runs on one whose boards are on CAN buses.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rtf import clock
from rtf.cli.demo_can import break_a_board
from rtf.cli.parser import Parser, add_dialect
from rtf.errors import RtfError
from rtf.middleware.naming.configuration import find_dialect
from rtf.testing.journal import results_of
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.bottle import Dialect
    from rtf.middleware.ports.network import Network
    from rtf.testing.results import RunResult

#: The suites of the battery: the longest first, so that the others run beside it.
BATTERY = ("control", "encoders", "motors", "basics", "stress", "sensors", "streams")
#: The suite with a share of the battery on a robot of YARP 4.
YARP4_SHARE = "yarp4"
#: The suite in which a robot looks at a red ball and reaches for it, of which it makes a film.
RED_BALL = "redball"
#: The suite with a share of it on a robot whose boards are on CAN buses.
CAN_SHARE = "bus"


class _Shown(NamedTuple):
    """A run of the demonstration: exit code, tests, unexpected results, page, and a note for the last line."""

    code: ExitCode
    tests: int
    wrong: list[str]
    page: Path
    note: str = ""


def demo(words: Sequence[str]) -> ExitCode:
    """Run the demonstration in a folder of its own, and compare it with what is expected."""
    parser = Parser(prog="rtf demo", description="Run the demonstration and check every verdict.")
    parser.add_argument("--runs", metavar="DIR", default="rtf-runs", help="where the folders of the runs are made")
    parser.add_argument("--quick", action="store_true", help="leave out the battery, which takes some minutes")
    add_dialect(parser)
    options, rest = parser.parse_known_args(words)
    from rtf.cli.demo_application import run_application

    dialect = find_dialect()
    runs = Path(options.runs)
    first = _what_goes_wrong(runs, rest)
    if first.code not in (ExitCode.PASSED, ExitCode.FAILURES):
        return first.code
    shown = [first]
    wrong = first.wrong + _show("two programs that talk", talk)
    wrong += _show("an application", lambda: run_application(runs))
    if _can_simulate():
        wrong += _show("a robot that moves", lambda: move(runs))
        if find_spec("can"):
            print("\nA bus of the robot's boards, one of which is off the bus")
            wrong += _show("a broken board", lambda: break_a_board(runs))
        if not options.quick:
            shown.append(_battery(runs / "battery", dialect))
            wrong += shown[-1].wrong
    return _verdict(shown, wrong)


def _verdict(shown: Sequence[_Shown], wrong: Sequence[str]) -> ExitCode:
    print()
    for line in wrong:
        print(f"not as expected: {line}")
    total = sum(one.tests for one in shown)
    if wrong:
        print(f"DEMO FAILED  {len(wrong)} of {total} expectations were not met")
        return ExitCode.FAILURES
    for one in shown:
        print(f"A page to look at in a browser: {one.page.resolve()}")
    notes = "".join(one.note for one in shown)
    print(f"DEMO PASSED  all {total} tests ended as expected: crash, hang, lost fixture and the rest{notes}")
    return ExitCode.PASSED


def _show(what: str, show: Callable[[], list[str]]) -> list[str]:
    """Print the lines of a function; return its error, if it raises one."""
    print()
    try:
        print("\n".join(show()))
    except (RtfError, OSError) as error:
        return [f"{what}: {error}"]
    return []


def _what_goes_wrong(runs: Path, rest: Sequence[str]) -> _Shown:
    """Run the suite in which everything goes wrong that can."""
    from rtf.cli import testrunner
    from rtf.testing.plugins import shipped_folder

    folder = shipped_folder("suites") / "demo"
    latest = runs / "latest"
    page = ["--web-reporter", "--web-port", "0", "--history", str(runs / "demo-history.sqlite")]
    before = latest.resolve()
    if (before / "journal.jsonl").exists():
        page += ["--compare", str(before)]
    reports = ["--junit", str(runs / "demo-junit.xml"), "--json", str(runs / "demo.json")]
    run = ["--suite", str(folder / "demo.xml"), "--runs", str(runs), "--answer", "default"]
    code = ExitCode(testrunner.main([*run, *page, *reports, *rest]))
    if code not in (ExitCode.PASSED, ExitCode.FAILURES):
        return _Shown(code, 0, [], latest)
    results = results_of(latest)
    expected = tomllib.loads((folder / "expected.toml").read_text(encoding="utf-8"))
    return _Shown(code, len(results.tests), compare(results, expected), (latest / "report.html").resolve())


def _can_simulate() -> bool:
    """Return whether the packages of the simulator are installed; print a hint if not."""
    from rtf.robot.model import RobotModelError, default_robot
    from rtf.robot.model.engine import mujoco
    from rtf.robot.model.errors import MissingPackageError

    try:
        mujoco()
        default_robot()
    except (MissingPackageError, RobotModelError) as error:
        print(f"\nWithout a robot: {error}")
        return False
    return True


def _battery(runs: Path, dialect: Dialect | None) -> _Shown:
    """Run all tests of a lab, on simulated robots of one dialect, or of both if none is set."""
    from rtf.cli import testrunner
    from rtf.testing.plugins import shipped_folder

    print("\nThe battery: all tests of a lab, on the simulated robot; it takes some minutes")
    folder = shipped_folder("suites") / "icubSim"
    suites = [word for name in battery_suites(dialect) for word in ("--suite", str(folder / f"{name}.xml"))]
    page = ["--web-reporter", "--web-port", "0", "--history", str(runs / "battery-history.sqlite")]
    runs.mkdir(parents=True, exist_ok=True)
    words = ["--runs", str(runs), "--answer", "default", "--junit", str(runs / "battery-junit.xml")]
    words += ["--jobs", str(len(os.sched_getaffinity(0)))]
    code = ExitCode(testrunner.main([*suites, *words, *page]))
    results = results_of(runs / "latest")
    tests = results.tests.values()
    wrong = [f"battery: {test.id}: {test.verdict}" for test in tests if test.verdict is None or not test.verdict.good]
    if code != ExitCode.PASSED and not wrong:
        wrong.append(f"battery: it ended with exit code {code}")
    for film in sorted((runs / "latest").glob("files/*/*/red-ball.webp")):
        print(f"A film of a robot that looks at a red ball and reaches for it: {film.resolve()}")
    on_4, on_can = (sum(test.id.startswith(f"{share}/") for test in tests) for share in (YARP4_SHARE, CAN_SHARE))
    note = f"; battery: {len(tests) - on_4 - on_can} tests with YARP {dialect or 3}"
    note += f", {on_4} with YARP 4" if on_4 else ""
    note += f", {on_can} on CAN buses" if on_can else ""
    return _Shown(code, len(tests), wrong, (runs / "latest" / "report.html").resolve(), note)


def battery_suites(dialect: Dialect | None) -> tuple[str, ...]:
    """Return the names of the suites of the battery.

    One of them has a robot of YARP 4, unless a dialect is set, and one has a robot with CAN buses, if python-can is
    installed.
    """
    return *_cameras(), *BATTERY, *([] if dialect else [YARP4_SHARE]), *([CAN_SHARE] if find_spec("can") else [])


def _cameras() -> tuple[str, ...]:
    """Return the suites of the cameras and of the red ball, if the machine can make pictures."""
    from rtf.simulator.errors import RenderingError
    from rtf.simulator.rendering import rendering_back_end

    try:
        rendering_back_end()
    except RenderingError as error:
        print(f"Without the tests of the cameras, and without the red ball: {error}")
        return ()
    if not find_spec("daqp"):
        print("Without the red ball: pip install 'rtf[kinematics]'")
        return ("cameras",)
    return RED_BALL, "cameras"


def compare(results: RunResult, expected: dict[str, dict[str, object]]) -> list[str]:
    """Return the differences between results and expectations, a line each."""
    wrong = []
    for name, verdict in expected["verdicts"].items():
        test = results.tests.get(f"demo/{name}")
        if test is None or test.last is None:
            wrong.append(f"{name}: is not in the results")
            continue
        if test.verdict != verdict:
            wrong.append(f"{name}: {test.verdict}, expected {verdict}: {test.last.detail}")
        reason = expected["reasons"].get(name)
        if reason is not None and test.last.reason != reason:
            wrong.append(f"{name}: reason {test.last.reason!r}, expected {reason!r}")
    unknown = [test.id for test in results.tests.values() if test.id.partition("/")[2] not in expected["verdicts"]]
    wrong.extend(f"{name}: this test is not among the expected ones" for name in unknown)
    incidents = sum(len(suite.incidents) for suite in results.suites.values())
    if incidents != expected["fixture"]["incidents"]:
        wrong.append(f"{incidents} fixture incidents, expected {expected['fixture']['incidents']}")
    return wrong


_SAYING = '[set] [pos] 0 12.5 "two words"'
_QUESTIONS = 50
_TALK_LIMIT = 20.0


def talk() -> list[str]:
    """Run two programs that talk over a network of their own; return what happened, a line each.

    Raises MiddlewareError, or OSError, when they do not understand each other.
    """
    from rtf.cli.demo_network import demo_network
    from rtf.middleware.errors import ProtocolError

    with demo_network() as (network, environment, _):
        command = [sys.executable, "-m", "rtf", "read", "/demo/reader", "once"]
        with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as reader:
            try:
                lines = _write(network, reader)
                heard, _ = reader.communicate(timeout=_TALK_LIMIT)
            finally:
                reader.kill()
        if heard.strip() != _SAYING:
            raise ProtocolError(f"the reader was sent {_SAYING!r} and printed {heard.strip()!r}")
        return [*lines, f"  process {reader.pid} printed what it was sent: {heard.strip()}"]


def _write(network: Network, reader: subprocess.Popen[str]) -> list[str]:
    from statistics import median

    from rtf.bottle import Bottle
    from rtf.cli.demo_network import await_port
    from rtf.middleware.ports import remote
    from rtf.middleware.ports.port import Port
    from rtf.middleware.wire.contact import Contact

    target = Contact(name="/demo/reader")
    await_port(network, target.name, reader)
    times = []
    for _ in range(_QUESTIONS):
        began = clock.monotonic()
        remote.administer(network, target, Bottle.parse("[ver]"))
        times.append(clock.monotonic() - began)
    with Port("/demo/writer", network=network, inputs=False) as writer:
        found = writer.add_output("/demo/reader", "tcp")
        writer.write(Bottle.parse(_SAYING))
    return [
        f"Two programs talk as YARP's do: /demo/writer here, /demo/reader in process {reader.pid} ({found.by('tcp')})",
        f"  a connection, a question and its answer take {median(times) * 1e3:.2f} ms",
    ]


_ROBOT = "icubSim"
_JOINT, _TARGET, _SPEED = "l_elbow", 90.0, 40.0  # deg, deg/s
_ROBOT_LIMIT = 60.0


def move(runs: Path) -> list[str]:
    """Start a robot, move its arm through the network, and keep a picture of its left eye; return what happened.

    Raises RtfError, or OSError, when something does not work.
    """
    from rtf.cli.demo_network import demo_network

    with demo_network() as (network, environment, folder):
        ready = folder / "ready"
        words = ["--robot", _ROBOT, "--parts", "head,left_arm", "--lockstep", "--cameras", "auto"]
        command = [sys.executable, "-m", "rtf", "simulator", *words, "--ready-file", str(ready)]
        began = clock.monotonic()
        with subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL) as simulator:
            try:
                _wait_for(ready, simulator)
                line = f"A simulated iCub is ready after {clock.monotonic() - began:.2f} s, in process {simulator.pid}"
                return [line, *_command(network, runs)]
            finally:
                simulator.terminate()


def _wait_for(ready: Path, simulator: subprocess.Popen[bytes]) -> None:
    from rtf.cli.demo_network import DemonstrationError

    deadline = clock.Deadline.after(_ROBOT_LIMIT)
    while not ready.exists():
        if simulator.poll() is not None:
            raise DemonstrationError(
                f"the simulator ended with {simulator.returncode}; see rtf simulator --robot {_ROBOT}"
            )
        if deadline.expired:
            raise DemonstrationError(f"the simulator was not ready within {_ROBOT_LIMIT:g} s")
        clock.sleep(0.02)


def _command(network: Network, runs: Path) -> list[str]:
    from rtf.cli.demo_network import DemonstrationError
    from rtf.middleware.clocks.network_clock import LockstepClock
    from rtf.robot.boards.client import connect

    began = clock.monotonic()
    with clock.use(LockstepClock("/clock", "demonstration", network=network)) as time:
        with connect(f"/{_ROBOT}/left_arm", carrier="tcp", network=network) as arm:
            joint = arm.axis_names().index(_JOINT)
            time.sleep(0.1)
            start, left = arm.encoder(joint), time.now()
            arm.set_reference_speeds(_SPEED, joint)
            arm.position_move(_TARGET, joint)
            while not arm.motion_done(joint):
                time.sleep(0.05)
            time.sleep(0.2)
            reached, seconds = arm.encoder(joint), time.now() - left
        if abs(reached - _TARGET) > 1.0:
            raise DemonstrationError(f"{_JOINT} was to move to {_TARGET:g} deg and is at {reached:.2f}")
        factor = seconds / (clock.monotonic() - began)
        moved = f"  {_JOINT} moved from {start:.1f} to {reached:.1f} deg in {seconds:.2f} s of its time"
        return [f"{moved}, {factor:.0f} times as fast as a robot", _look(network, runs)]


def _look(network: Network, runs: Path) -> str:
    """Keep a picture of the left eye, if the machine can make one."""
    from rtf.middleware.ports import remote
    from rtf.middleware.wire.contact import Contact

    if not remote.exists(network, Contact(f"/{_ROBOT}/cam/left/rpc")):
        return "  no picture: this machine cannot make any; see rtf simulator --cameras yes"
    from rtf.bottle import Property
    from rtf.robot.sensors.camera import FrameGrabberClient
    from rtf.robot_testing.judging.png import png

    eye = FrameGrabberClient("eye", network=network)
    eye.open(Property({"local": "/demo/eye", "remote": f"/{_ROBOT}/cam/left", "no_stream": 1}))
    try:
        image, _ = eye.image()
    finally:
        eye.close()
    runs.mkdir(parents=True, exist_ok=True)
    picture = runs / "demo-left-eye.png"
    picture.write_bytes(png(image.pixels))
    return f"  what its left eye sees: {picture.resolve()}"
