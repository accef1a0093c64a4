"""Test drafts of other robots: ``python tests/benchmarks/run_robots_benchmarks.py``; it needs ``rtf[robots]``.

For each robot the draft of ``rtf robot new`` is tested as it is: the battery of ``rtf robot test`` with some seeds,
where everything that does not pass is a false alarm, and ten kinds of faults, each at joints drawn at random, by a test
that claims the kind. A fault is found if that test fails, and the joint is named if its first failure is of that joint.
"""

from __future__ import annotations

import argparse
import random
import resource
import subprocess
import sys
import tempfile
from importlib.metadata import distribution
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rtf import clock
from rtf.robot.model import load_robot
from rtf.robot_testing.proof import Case, Expectation, Judgement, judge, write_suites
from rtf.testing.journal import results_of
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from rtf.robot.model import Axis, RobotModel
    from rtf.robot_testing.proof import JudgedCase
    from rtf.testing.results import TestResult

PACKAGE = "example-robot-data"
ROBOTS = {
    "ur5": "ur_description/urdf/ur5_robot.urdf",
    "panda": "panda_description/urdf/panda.urdf",
    "allegro": "allegro_hand_description/urdf/allegro_left_hand.urdf",
    "tiago": "tiago_description/robots/tiago.urdf",
    "talos": "talos_data/robots/talos_reduced.urdf",
}
#: Kinds of faults, the test that claims each, and the value that goes with the strength of the drive (shares of it).
FAULTS: dict[str, tuple[str, dict[str, float]]] = {
    "motor_dead": ("MotorTest", {}),
    "jam": ("MotorTest", {"torque": 5.0}),
    "friction": ("MotorStiction", {"torque": 0.5}),
    "wrong_gains": ("PositionControlAccuracy", {}),
    "missed_command": ("PositionDirect", {}),
    "motor_encoder_sign": ("MotorEncodersSignCheck", {}),
    "motor_encoder_scale": ("OpticalEncodersConsistency", {}),
    "encoder_frozen": ("OpticalEncodersConsistency", {}),
    "limits_ignored": ("JointLimits", {}),
    "mode_ignored": ("ControlModes", {}),
}
_RTF = (sys.executable, "-m", "rtf")
_TESTRUNNER = (*_RTF[:2], "rtf.cli.testrunner")
_GOOD = frozenset({Verdict.PASSED, Verdict.MEASURED, Verdict.SKIPPED})


class Battery(NamedTuple):
    """The batteries of a healthy robot: seeds, tests in each, time of each, and what did not pass, as text."""

    seeds: int
    tests: int
    seconds: float
    cpu: float  # s, of all its processes
    alarms: list[str]


class Found(NamedTuple):
    """The faults of a robot: how many were tried, found, and named first; and what was not, as text."""

    tried: int
    found: int
    named: int
    missed: list[str]


def make(name: str, folder: Path) -> RobotModel:
    """Draft a robot by the command, and read it."""
    (path,) = (file.locate() for file in distribution(PACKAGE).files or [] if str(file).endswith(ROBOTS[name]))
    words = [*_RTF, "robot", "new", str(path), "--name", name, "--package", PACKAGE]
    subprocess.run(words, cwd=folder, check=True, capture_output=True)
    return load_robot(f"{folder / 'robots' / name}/")


def battery(robot: RobotModel, folder: Path, seeds: Iterable[int], jobs: int) -> Battery:
    """Run the whole battery with each seed."""
    alarms, tests, times, used = list[str](), 0, list[float](), _cpu()
    for seed in seeds:
        began, run = clock.monotonic(), folder / f"{robot.name}-{seed}"
        words = ["--define", f"seed={seed}", "--run-folder", str(run), "--answer", "default", "-q", "-j", str(jobs)]
        subprocess.run([*_RTF, "robot", "test", f"{robot.folder}/", *words], cwd=folder, check=False, stdout=sys.stderr)
        times.append(clock.monotonic() - began)
        results = results_of(run).tests
        tests = len(results)
        alarms += [f"seed {seed}: {one.label}: {_first(one)}" for one in results.values() if one.verdict not in _GOOD]
    count = max(1, len(times))
    return Battery(len(times), tests, sum(times) / count, (_cpu() - used) / count, alarms)


def _cpu() -> float:
    """Return the processor time (s) of all processes that this one started, directly or not, and that ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _first(result: TestResult) -> str:
    """Return the first problem of a test in a line."""
    return f"{result.verdict}: " + (result.problems[0].detail if result.problems else "it says nothing")


def cases(robot: RobotModel, joints: int, draw: int, kinds: Sequence[str]) -> list[Case]:
    """Draw joints for each kind of fault."""
    drawn, found = random.Random(draw), []
    for kind in kinds:
        test, shares = FAULTS[kind]
        for axis in drawn.sample(robot.axes, min(joints, len(robot.axes))):
            values = {key: share * axis.max_torque for key, share in shares.items()}
            if kind == "limits_ignored":
                values = {"by": 5.0 * axis.degree / axis.internal}
            found.append(_case(robot, axis, test, kind, values))
    return found


def _case(robot: RobotModel, axis: Axis, test: str, kind: str, values: dict[str, float]) -> Case:
    parameters = {"part": axis.part}
    place = f"{robot.folder}/"
    return Case(test, Expectation.FOUND, kind, axis.name, values, axis.name, parameters, robot=place, timeout=600.0)


def faults(wanted: Sequence[Case], folder: Path) -> Found:
    """Run the tests of all cases, and count."""
    folder.mkdir()
    files, by_test = write_suites(wanted, folder)
    words = [word for file in files for word in ("--suite", str(file))]
    run = folder / "run"
    subprocess.run(
        [*_TESTRUNNER, *words, "--run-folder", str(run), "--answer", "default", "-q"],
        cwd=folder, check=False, stdout=sys.stderr,
    )  # fmt: skip
    results = results_of(run).tests
    return counted([(judge(case, results.get(test)), results.get(test)) for test, case in by_test.items()])


def counted(judged: Sequence[tuple[JudgedCase, TestResult | None]]) -> Found:
    """Count the faults that were found, and those whose joint is that of the first failure."""
    found = [(one, result) for one, result in judged if one.verdict == str(Verdict.FAILED)]
    named = [one for one, result in found if one.judgement is Judgement.FOUND and _is_first(one.case, result)]
    missed = [f"{one.case.name}: {one.judgement.value}: {one.sentence}" for one, _ in judged if one not in named]
    return Found(len(judged), len(found), len(named), missed)


def _is_first(case: Case, result: TestResult | None) -> bool:
    """Return whether the first failure of a test is of the faulty joint: by its sub-result, else by its words."""
    if result is None or not result.problems:
        return False
    first = result.problems[0]
    return case.names in first.subject.replace("/", " ").split(" ") if first.subject else case.names in first.detail


def row(robot: RobotModel, healthy: Battery | None, found: Found | None) -> str:
    """Return the row of a robot in the table of docs/your-own-robot.md."""
    cells = [robot.title, str(len(robot.axes)), str(len(robot.parts))]
    if healthy is not None:
        minutes, seconds = divmod(round(healthy.seconds), 60)
        whole = healthy.seeds * healthy.tests
        cells += [
            f"{minutes} min {seconds} s, {healthy.cpu:.0f} s of processors",
            f"{len(healthy.alarms)} of {whole} tests ({healthy.seeds} seeds)",
        ]
    if found is not None:
        cells += [f"{found.found} of {found.tried}", f"{found.named} of {found.tried}"]
    return f"| {' | '.join(cells)} |"


def main(arguments: list[str] | None = None) -> int:
    """Test the robots, print the table and what was not as it should be; 1 if there is any."""
    parser = argparse.ArgumentParser(description="Drafts of other robots: time, false alarms, faults found.")
    parser.add_argument("robots", nargs="*", metavar="NAME", help=f"{', '.join(ROBOTS)} (default: all)")
    parser.add_argument("--seeds", type=int, default=1, help="batteries of each healthy robot")
    parser.add_argument("--first", type=int, default=1, help="the first seed")
    parser.add_argument("--jobs", type=int, default=1, help="tests at the same time, each with a robot of its own")
    parser.add_argument("--joints", type=int, default=3, help="joints drawn for each kind of fault; 0: no faults")
    parser.add_argument("--draw", type=int, default=0, help="the seed of the draw")
    parser.add_argument("--kinds", nargs="+", choices=FAULTS, default=list(FAULTS), help="kinds of faults")
    options = parser.parse_args(arguments)
    print("| robot | joints | parts | battery | false alarms | faults found | joint named first |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    wrong: list[str] = []
    with tempfile.TemporaryDirectory(prefix="rtf-benchmark-") as place:
        for name in options.robots or ROBOTS:
            folder = Path(place)
            robot = make(name, folder)
            seeds = range(options.first, options.first + options.seeds)
            healthy = battery(robot, folder, seeds, options.jobs) if options.seeds else None
            chosen = cases(robot, options.joints, options.draw, options.kinds)
            found = faults(chosen, folder / f"{name}-faults") if chosen else None
            print(row(robot, healthy, found), flush=True)
            lines = [*(healthy.alarms if healthy else ()), *(found.missed if found else ())]
            named = [f"{name}: {one}" for one in lines]
            print("\n".join(named), file=sys.stderr, flush=True)
            wrong += named
    print("\n".join(["", *wrong]))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
