"""Judgement of cases: comparison of the runner's results with the claims."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from rtf.robot_testing.proof.cases import Expectation
from rtf.robot_testing.proof.claims import robot_of
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot_testing.proof.cases import Case
    from rtf.testing.events import Message
    from rtf.testing.results import TestResult


class Judgement(Enum):
    """The judgement of a case; the first four are good."""

    FOUND = "found"
    SILENT = "silent"
    HEALTHY = "healthy"
    EXPECTED = "expected"
    MISSED = "missed"  # the test passed in spite of the fault
    UNNAMED = "unnamed"  # the test failed, and named something else
    ALARM = "false alarm"  # the test did not pass although it should have
    NOT_TESTED = "not tested"  # the test was not run, or could not judge

    @property
    def good(self) -> bool:
        """Whether the claim holds."""
        return self in _GOOD


_GOOD = frozenset({Judgement.FOUND, Judgement.SILENT, Judgement.HEALTHY, Judgement.EXPECTED})
_PASSED = frozenset({Verdict.PASSED, Verdict.MEASURED})


@dataclass(frozen=True, slots=True)
class JudgedCase:
    """A case with its judgement, and the message of the test that it is based on."""

    case: Case
    judgement: Judgement
    verdict: str
    sentence: str
    seconds: float


def judge(case: Case, result: TestResult | None) -> JudgedCase:
    """Judge a case by its result."""
    if result is None or result.verdict is None:
        return JudgedCase(case, Judgement.NOT_TESTED, "", "it was not run", 0.0)
    verdict = result.verdict
    last = result.last
    sentence = "" if last is None else last.detail
    if result.problems:
        first = result.problems[0]
        sentence = f"{first.subject}: {first.detail}" if first.subject else first.detail
    return JudgedCase(case, _judgement(case, verdict, result.problems), str(verdict), sentence, result.duration)


def _judgement(case: Case, verdict: Verdict, problems: Sequence[Message]) -> Judgement:
    passed, expectation = verdict in _PASSED, case.expectation
    if expectation is Expectation.OTHER and not passed:
        return _loud(case, verdict, problems)
    if verdict in NO_STATEMENT and not (expectation is Expectation.EXPECTED and verdict is Verdict.INCONCLUSIVE):
        return Judgement.NOT_TESTED
    if expectation is Expectation.FOUND or (expectation is Expectation.LIMIT and not passed):
        return _found(case, verdict, problems)
    if expectation is Expectation.EXPECTED:
        return Judgement.MISSED if passed else Judgement.EXPECTED
    if not passed:
        return Judgement.ALARM
    return Judgement.HEALTHY if expectation is Expectation.HEALTHY else Judgement.SILENT


def _loud(case: Case, verdict: Verdict, problems: Sequence[Message]) -> Judgement:
    """Judge a test that does not pass on a fault without a claim: what it says is true, or there is a reason."""
    named = bool(case.names) and any(_names(one, case) for one in problems)
    if verdict is Verdict.FAILED and named and not any(_blames_another_joint(one, case) for one in problems):
        return Judgement.FOUND
    if case.reason:
        return Judgement.EXPECTED
    return Judgement.NOT_TESTED if verdict in NO_STATEMENT else Judgement.ALARM


def _found(case: Case, verdict: Verdict, problems: Sequence[Message]) -> Judgement:
    if verdict in _PASSED:
        return Judgement.MISSED
    if verdict is not Verdict.FAILED:
        return Judgement.NOT_TESTED
    return Judgement.FOUND if any(_names(problem, case) for problem in problems) else Judgement.UNNAMED


def _names(problem: Message, case: Case) -> bool:
    """Return whether a failure names the faulty component. A failure of a joint's sub-result is of that joint only."""
    names, of_joint = {case.names}, case.names in robot_of(case.robot).index
    if of_joint and case.names == case.target:
        names |= faulty_joints(case)
    if of_joint and (joints := _joints(problem, case)):
        return not joints.isdisjoint(names)
    return any(name in f"{problem.subject}: {problem.detail}" for name in names)


def _blames_another_joint(problem: Message, case: Case) -> bool:
    joints = _joints(problem, case)
    return bool(joints) and joints.isdisjoint(faulty_joints(case))


def _joints(problem: Message, case: Case) -> set[str]:
    """Return the joints in the name of the sub-result of a failure."""
    return robot_of(case.robot).index.keys() & set(re.split(r"[ /]", problem.subject))


def faulty_joints(case: Case) -> frozenset[str]:
    """Return the joints that a fault of an axis concerns: a kind that exchanges something concerns two.

    There are none for a fault of anything else, such as a sensor.
    """
    robot = robot_of(case.robot)
    place = robot.index.get(case.target)
    if place is None:
        return frozenset()
    other = round(case.values.get("by", 1.0)) if case.fault.endswith("_swapped") else 0
    return frozenset({robot.axes[place].name, robot.axes[place + other].name})


#: Verdicts that say nothing about the robot.
NO_STATEMENT = frozenset(
    {Verdict.SKIPPED, Verdict.NOT_RUN, Verdict.BLOCKED, Verdict.INTERRUPTED, Verdict.FIXTURE_LOST, Verdict.INCONCLUSIVE}
)
