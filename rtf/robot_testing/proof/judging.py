"""What came of the cases: the runner's results, compared with what was claimed."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from rtf.robot_testing.proof.cases import Expectation
from rtf.simulator.axes import INDEX
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot_testing.proof.cases import Case
    from rtf.testing.events import Message
    from rtf.testing.results import TestResult


class Judgement(Enum):
    """What is said of a case; the first four are as they should be."""

    FOUND = "found"
    SILENT = "silent"
    HEALTHY = "healthy"
    EXPECTED = "expected"
    MISSED = "missed"  # the fault was there and the test passed
    UNNAMED = "unnamed"  # it failed, and named something else
    ALARM = "false alarm"  # it did not pass, and should have
    NOT_TESTED = "not tested"  # it could not be carried out, or was not

    @property
    def good(self) -> bool:
        """Whether the claim holds."""
        return self in _GOOD


_GOOD = frozenset({Judgement.FOUND, Judgement.SILENT, Judgement.HEALTHY, Judgement.EXPECTED})
_PASSED = frozenset({Verdict.PASSED, Verdict.MEASURED})


@dataclass(frozen=True, slots=True)
class Finding:
    """A case, what is said of it, and the sentence of the test that it rests on."""

    case: Case
    judgement: Judgement
    verdict: str
    sentence: str
    seconds: float


def judge(case: Case, result: TestResult | None) -> Finding:
    """Compare a case with its result."""
    if result is None or result.verdict is None:
        return Finding(case, Judgement.NOT_TESTED, "", "it was not run", 0.0)
    verdict = result.verdict
    failures = [f"{problem.subject}: {problem.detail}" for problem in result.problems]
    sentence = failures[0] if failures else ""
    last = result.last
    if not sentence and last is not None:
        sentence = last.detail
    return Finding(case, _said(case, verdict, result.problems), str(verdict), sentence, result.duration)


def _said(case: Case, verdict: Verdict, problems: Sequence[Message]) -> Judgement:
    passed, expectation = verdict in _PASSED, case.expectation
    if expectation is Expectation.OTHER and case.reason and not passed:
        return Judgement.EXPECTED
    if verdict in _NOTHING:
        return Judgement.NOT_TESTED
    if expectation is Expectation.FOUND:
        return _found(case, verdict, problems)
    if expectation is Expectation.EXPECTED:
        return Judgement.MISSED if passed else Judgement.EXPECTED
    if not passed:
        return Judgement.ALARM
    return Judgement.HEALTHY if expectation is Expectation.HEALTHY else Judgement.SILENT


def _found(case: Case, verdict: Verdict, problems: Sequence[Message]) -> Judgement:
    if verdict in _PASSED:
        return Judgement.MISSED
    if verdict is not Verdict.FAILED:
        return Judgement.NOT_TESTED
    return Judgement.FOUND if any(_names(problem, case.names) for problem in problems) else Judgement.UNNAMED


def _names(problem: Message, name: str) -> bool:
    """Whether a failure is of what is to be found. One that is filed under a joint is of no other, whatever it says."""
    joints = INDEX.keys() & set(re.split(r"[ /]", problem.subject))
    if joints and name in INDEX:
        return name in joints
    return name in f"{problem.subject}: {problem.detail}"


#: After these nothing is known of the robot.
_NOTHING = frozenset(
    {Verdict.SKIPPED, Verdict.NOT_RUN, Verdict.BLOCKED, Verdict.INTERRUPTED, Verdict.FIXTURE_LOST, Verdict.INCONCLUSIVE}
)
