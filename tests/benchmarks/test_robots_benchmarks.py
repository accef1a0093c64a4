"""The benchmark of other robots draws joints and counts what was found; what it runs, other tests run."""

from __future__ import annotations

from benchmarks.run_robots_benchmarks import FAULTS, Battery, cases, counted, row

from rtf.robot.model import load_robot
from rtf.robot_testing.proof import judge
from rtf.testing.events import Message, TestPlanned
from rtf.testing.results import TestResult
from rtf.testing.verdict import Severity, Verdict


def result(verdict: Verdict, *problems: tuple[str, str]) -> TestResult:
    """A test that ended like this, with failures of sub-results."""
    found = TestResult(TestPlanned(test="proof-0/case-0", suite="proof-0", name="case-0"), "case-0")
    found.verdict = verdict
    found.problems = [
        Message(severity=Severity.FAILURE, title="checks", subject=subject, detail=detail)
        for subject, detail in problems
    ]
    return found


def test_joints_are_drawn_for_each_kind():
    """The same ones for the same draw; what breaks goes with the strength of the drive."""
    robot = load_robot("bench")
    drawn = cases(robot, 3, 0, list(FAULTS))
    assert [case.name for case in drawn] == [case.name for case in cases(robot, 3, 0, list(FAULTS))]
    assert len(drawn) == 2 * len(FAULTS), "the bench has two joints"
    (jam, *_) = [case for case in drawn if case.fault == "jam" and case.target == "shoulder"]
    assert (jam.values, jam.parameters) == ({"torque": 5.0 * robot.axis("shoulder").max_torque}, {"part": "arm"})
    assert all(case.names == case.target for case in drawn)


def test_what_is_found_and_what_is_named_first():
    """A test that passes missed the fault; one that fails another joint first has found it, and named the wrong one."""
    case = next(one for one in cases(load_robot("bench"), 3, 0, ["jam"]) if one.target == "elbow")
    ended = [
        result(Verdict.FAILED, ("elbow", "does not move"), ("shoulder", "neither")),
        result(Verdict.FAILED, ("shoulder", "does not move"), ("elbow", "neither")),
        result(Verdict.FAILED, ("", "elbow (/benchSim/arm joint 1) draws 5 A")),
        result(Verdict.PASSED),
        result(Verdict.ERROR, ("elbow", "cannot be opened")),
    ]
    found = counted([(judge(case, one), one) for one in ended])
    assert (found.tried, found.found, found.named) == (5, 3, 2)
    assert [line.rpartition(": ")[2] for line in found.missed] == ["does not move", "", "cannot be opened"]
    healthy = Battery(seeds=2, tests=12, seconds=100.2, cpu=41.7, alarms=["seed 1: step arm: failed: late"])
    assert row(load_robot("bench"), healthy, found).endswith(
        "| 2 | 1 | 1 min 40 s, 42 s of processors | 1 of 24 tests (2 seeds) | 3 of 5 | 2 of 5 |"
    )
