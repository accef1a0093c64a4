"""Measure which joint the tests blame: ``python tests/benchmarks/run_blame_benchmarks.py``.

Every fault of an axis is injected at each of some joints of the simulated iCub, and some tests are run on that part.
Counted are the tests that do not pass: how many name the faulty joint first, and how often a healthy joint has failed.
A fault that a test does not notice counts for neither.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from measuring import TESTRUNNER

from rtf.robot.model import load_robot
from rtf.robot_testing.proof import Case, Expectation, faulty_joints, write_suites
from rtf.simulator.faults import KINDS, Target
from rtf.testing.events import Message, SubResultEnded
from rtf.testing.journal import read
from rtf.testing.verdict import Severity, Verdict

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

ROBOT = load_robot("icub")
#: Two of a coupled pair of each kind, and joints with a motor of their own.
JOINTS = ("l_shoulder_pitch", "l_shoulder_roll", "l_elbow", "l_wrist_pitch", "torso_roll", "l_knee")
#: Tests that move joints in turn, in position control, by steps and by duty cycles.
TESTS = ("OpticalEncodersConsistency", "PositionControlAccuracy", "MotorEncodersSignCheck", "position-stress")
#: The joints of a part that are tested: hands have many, and all of one kind.
_FIRST = 7
#: The test that always moves all joints of its part.
_WHOLE = "MotorTest"
#: What comes before the joint that explains a doubt.
_EXPLAINED = re.compile("explained by|it was disturbed|it shares motors")
#: The goals: shares of tests that name the right joint first, and of healthy joints that fail.
RIGHT, HEALTHY = 0.98, 0.005


class Blamed(NamedTuple):
    """A test that did not pass: the joints that are faulty, the one it named first, and the healthy ones it failed."""

    test: str
    fault: str
    target: str
    faulty: frozenset[str]
    first: str
    wrong: tuple[str, ...]
    judged: int  # healthy joints
    sentence: str

    @property
    def right(self) -> bool:
        """Whether it named the right joint first."""
        return self.first in self.faulty


def cases(tests: Sequence[str], faults: Sequence[str], joints: Sequence[str]) -> Iterator[Case]:
    """Yield the runs: each test with each fault of an axis at each joint that it tests, at its usual severity."""
    for test in tests:
        for fault in faults:
            for joint in joints:
                part = ROBOT.axis(joint).part
                axes = ROBOT.parts[part].axes[:_FIRST]
                by_torque = test.startswith("TorqueControl")
                chosen = [place for place, axis in enumerate(axes) if axis.torque_control or not by_torque]
                place = [axis.name for axis in axes].index(joint)
                if place not in chosen:
                    continue
                last = fault.endswith("_swapped") and place == chosen[-1]
                yield Case(
                    test, Expectation.FOUND, fault, joint, {"by": -1.0} if last else {}, joint,
                    {"part": part} if test == _WHOLE else {"part": part, "joints": chosen}, robot="icub",
                )  # fmt: skip


def run(chosen: Sequence[Case], folder: Path, jobs: int) -> dict[str, Case]:
    """Run the cases, and return them by the ids of their tests."""
    shutil.rmtree(folder / "run", ignore_errors=True)
    files, by_test = write_suites(chosen, folder)
    suites = [word for file in files for word in ("--suite", str(file))]
    words = [*TESTRUNNER, *suites, "--run-folder", str(folder / "run"), "-j", str(jobs), "--answer", "default", "-q"]
    subprocess.run(words, check=False, capture_output=True)
    return by_test


def judged(folder: Path, by_test: dict[str, Case]) -> tuple[list[Blamed], Counter[str]]:
    """Return who was blamed in the cases that did not pass, and how many of each verdict there are of all joints."""
    said: dict[str, list[tuple[str, str]]] = {test: [] for test in by_test}
    ended: dict[str, dict[str, Verdict]] = {test: {} for test in by_test}
    for event in read(folder):
        if isinstance(event, Message) and event.test in said:
            if event.severity in (Severity.FAILURE, Severity.ERROR):
                said[event.test].append((event.subject, event.detail))
        elif isinstance(event, SubResultEnded) and event.test in said:
            joint = next(iter(_joints_in(event.subject)), "")
            worst = Verdict.FAILED in (event.verdict, ended[event.test].get(joint))
            ended[event.test][joint] = Verdict.FAILED if worst else event.verdict
            if event.verdict is Verdict.INCONCLUSIVE:
                said[event.test].append(("", event.reason))
    blamed, verdicts = [], Counter[str]()
    for test, case in by_test.items():
        joints = {joint: verdict for joint, verdict in ended[test].items() if joint}
        verdicts.update(str(verdict) for verdict in joints.values())
        if said[test]:
            blamed.append(_blamed(case, said[test], joints))
    return blamed, verdicts


def _joints_in(text: str) -> list[str]:
    return [word for word in re.split(r"\W+", text) if word in ROBOT.index]


def _blamed(case: Case, said: list[tuple[str, str]], joints: dict[str, Verdict]) -> Blamed:
    """Evaluate one test: what its first failure names, or without any failure what explains the first doubt."""
    faulty = faulty_joints(case)
    subject, detail = next((one for one in said if one[0]), said[0])
    named = _joints_in(subject) or _joints_in(_EXPLAINED.split(detail)[-1])
    healthy = [joint for joint in joints if joint not in faulty]
    wrong = tuple(joint for joint in healthy if joints[joint] is Verdict.FAILED)
    first = next(iter(named), "")
    return Blamed(case.test, case.fault, case.target, faulty, first, wrong, len(healthy), f"{subject}: {detail}")


def table(blamed: Sequence[Blamed]) -> str:
    """Return the confusion matrix in Markdown: for each fault the tests that named the right joint first."""
    rows = ["| fault | not passed | right joint first | healthy joints failed |\n| --- | --- | --- | --- |\n"]
    for fault in dict.fromkeys(one.fault for one in blamed):
        those = [one for one in blamed if one.fault == fault]
        rows.append(
            f"| {fault} | {len(those)} | {sum(one.right for one in those)} | "
            f"{sum(len(one.wrong) for one in those)} of {sum(one.judged for one in those)} |\n"
        )
    return "".join(rows)


def report(blamed: Sequence[Blamed]) -> bool:
    """Print the matrix, every wrong case and the sums; return whether the goals are reached."""
    print(table(blamed))
    for one in blamed:
        if not one.right or one.wrong:
            print(f"{one.test} on {one.fault} {one.target}: named {one.first or 'nobody'}, failed {one.wrong}")
            print(f"    {one.sentence}")
    right, wrong = sum(one.right for one in blamed), sum(len(one.wrong) for one in blamed)
    healthy = sum(one.judged for one in blamed)
    print(f"right joint named first: {right} of {len(blamed)}; goal {RIGHT:.0%}")
    print(f"healthy joints failed: {wrong} of {healthy}; goal {HEALTHY:.1%}")
    return right >= RIGHT * len(blamed) and wrong <= HEALTHY * healthy


def main(arguments: list[str] | None = None) -> int:
    """Run what was asked for; 1 if a goal is missed."""
    every = [name for name, kind in KINDS.items() if kind.target_kind is Target.AXIS and not kind.stimulus]
    parser = argparse.ArgumentParser(description="Which joint is blamed; all of it an hour with one robot at a time.")
    parser.add_argument("--tests", nargs="+", default=TESTS, metavar="TEST")
    parser.add_argument("--faults", nargs="+", default=every, choices=every, metavar="FAULT")
    parser.add_argument("--joints", nargs="+", default=JOINTS, choices=list(ROBOT.index), metavar="JOINT")
    parser.add_argument("-j", "--jobs", type=int, default=1, help="robots at a time")
    parser.add_argument("--folder", help="where suites and results are kept; default: nowhere")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="rtf-blame-") as temporary:
        folder = Path(options.folder or temporary)
        folder.mkdir(parents=True, exist_ok=True)
        by_test = run([*cases(options.tests, options.faults, options.joints)], folder, options.jobs)
        blamed, verdicts = judged(folder / "run", by_test)
    print(f"{len(by_test)} tests; joints: {', '.join(f'{count} {word}' for word, count in verdicts.items())}\n")
    return 0 if report(blamed) else 1


if __name__ == "__main__":
    sys.exit(main())
