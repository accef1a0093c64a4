"""The cases of a program under test as tests of their own: planned, started and ended when the program reports them.

A test that is a program has its own verdict (it crashed, broke the protocol, ended with an unexplained exit status);
each case that it reports is a test below it. The program's process only reports the results of its cases; their
verdicts over repetitions, attempts and lost fixtures are decided here, in the thread of the program's suite worker.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from msgspec.structs import replace

from rtf.testing.events import Event, TestEnded, TestPlanned, TestStarted
from rtf.testing.suite.ids import CaseIds
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.testing.isolation.messages import Case
    from rtf.testing.suite.model import TestEntry

#: More cases of one program are no tests of their own; if one of them is bad, the program is failed.
MAX_CASES = 100_000

#: The verdict of several runs of a case: the first of these that one of them had.
_WORST = (Verdict.FAILED, Verdict.ERROR, Verdict.PASSED, Verdict.EXPECTED_FAILURE)
#: Verdicts of a program that hold for the cases that it did not report, too.
_SHARED = frozenset({Verdict.SKIPPED, Verdict.FIXTURE_LOST, Verdict.INTERRUPTED})
_REASONS = {Verdict.FAILED: "failure", Verdict.FIXTURE_LOST: "fixture"}


@dataclass(slots=True)
class _CaseTest:
    """One case: its results in the runs of this attempt, and its bad verdicts in earlier attempts."""

    id: str
    results: list[Case] = field(default_factory=list)
    before: list[Verdict] = field(default_factory=list)
    final: bool = False

    @property
    def outcome(self) -> Case:
        """Return the worst of this attempt's runs."""
        return next((case for verdict in _WORST for case in self.results if case.verdict is verdict), self.results[-1])


def planned_case(program: TestPlanned, test: str, name: str, file: str = "", line: int = 0) -> TestPlanned:
    """Return the event that plans a case of a program; a case without a file has the program's place."""
    return TestPlanned(
        test=test,
        suite=program.suite,
        name=f"{program.name}::{name}",
        plugin=program.plugin,
        type=program.type,
        tags=program.tags,
        file=file or program.file,
        line=line if file else program.line,
        retries=program.retries,
        parent=program.test,
        case=name,
    )


class CaseTests:
    """The cases of one program over all attempts at it.

    ``judge`` returns the final verdict of a case from its last verdict and from its bad verdicts in earlier attempts.
    With ``live`` the program runs only once, so that the end of a case is reported at once; else it is reported when
    the attempt is over.
    """

    def __init__(
        self,
        entry: TestEntry,
        program: TestPlanned,
        emit: Callable[[Event], None],
        judge: Callable[[Verdict, list[Verdict]], Verdict],
        *,
        live: bool,
    ) -> None:
        self._program = program
        self._emit = emit
        self._judge = judge
        self._live = live
        self._ids = CaseIds(entry.id, {name: test for test, name in entry.cases})
        self._tests = {name: _CaseTest(test) for test, name in entry.cases}
        self._limited = bool(entry.cases)
        self._attempt = 0
        self.any_bad = False  # in this attempt
        self.failures = 0  # cases whose final verdict is not good

    def begin(self, attempt: int) -> tuple[str, ...]:
        """Begin an attempt at the program. Returns the names of the only cases that it is to run; none means all."""
        self._attempt = attempt
        self.any_bad = False
        return tuple(name for name, test in self._tests.items() if not test.final) if self._limited else ()

    def take(self, case: Case) -> bool:
        """Add a result of a case. Returns False if the program has too many cases.

        A case that was not wanted, but that the program ran, does not count.
        """
        test = self._tests.get(case.name)
        if test is None and not self._limited:
            if len(self._tests) >= MAX_CASES:
                return False
            test = self._tests[case.name] = _CaseTest(self._ids.of(case.name))
            self._emit(planned_case(self._program, test.id, case.name, case.file, case.line))
        if test is not None and not test.final:
            test.results.append(case)
            self.any_bad = self.any_bad or not case.verdict.good
            if self._live:
                self._end(test, Verdict.PASSED, "", final=True)
        return True

    def end_attempt(self, outcome: Verdict, detail: str, *, again: bool) -> None:
        """Report the ends of the cases in the attempt, in which the program itself had the verdict ``outcome``.

        If the program is tried ``again``, it runs the cases that were bad, or all if the program itself was bad.
        """
        only_cases = again and outcome.good
        for test in self._tests.values():
            if test.results and not test.final:
                self._end(test, outcome, detail, final=not again or (only_cases and test.outcome.verdict.good))
        self._limited = self._limited or only_cases
        if not again:
            self.give_up(
                outcome if outcome in _SHARED else Verdict.ERROR,
                "missing",
                "the program did not report this case" + (f" this time: {detail}" if detail else ""),
            )

    def give_up(self, verdict: Verdict, reason: str, detail: str) -> None:
        """Report the final end of each case without one: the program is not run, or has not reported the case."""
        for test in self._tests.values():
            if not test.final:
                worst = Verdict.FAILED if Verdict.FAILED in test.before else Verdict.ERROR
                said = worst if test.before else verdict
                self._emit_end(
                    test,
                    TestEnded(test=test.id, verdict=said, outcome=verdict, attempt=0, reason=reason, detail=detail),
                )

    def _end(self, test: _CaseTest, program: Verdict, why: str, *, final: bool) -> None:
        """Report the end of a case in this attempt. If a fixture was lost, the case is *fixture lost*, too."""
        case = test.outcome
        outcome, detail = case.verdict, case.detail
        if program is Verdict.FIXTURE_LOST:
            outcome, detail = program, f"{why}; the case itself had come to: {case.verdict}"
        self._emit(TestStarted(time=case.time - case.duration, test=test.id, attempt=self._attempt))
        for result in test.results:
            for message in result.messages:
                self._emit(replace(message, seq=0, test=test.id, suite="", fixture="", subject=result.subject))
        ended = TestEnded(
            time=case.time,
            test=test.id,
            verdict=self._judge(outcome, test.before) if final else outcome,
            outcome=outcome,
            attempt=self._attempt,
            final=final,
            reason="" if outcome.good else _REASONS.get(outcome, "error"),
            detail=detail,
            duration=sum(one.duration for one in test.results),
        )
        if outcome in (Verdict.FAILED, Verdict.ERROR):
            test.before.append(outcome)
        test.results.clear()
        self._emit_end(test, ended)

    def _emit_end(self, test: _CaseTest, ended: TestEnded) -> None:
        test.final = ended.final
        self.failures += ended.final and not ended.verdict.good
        self._emit(ended)
