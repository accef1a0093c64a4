"""Verdicts and counts of a run, folded from its events."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Self

from rtf.testing.events import (
    Diagnosed,
    Event,
    FixtureChanged,
    FixtureIncident,
    InternalError,
    Interrupted,
    Measured,
    Message,
    OutputCaptured,
    PhaseStarted,
    PlanChanged,
    Progressed,
    RunEnded,
    RunStarted,
    SeriesSampled,
    SuiteEnded,
    SuitePlanned,
    SuiteStarted,
    TestEnded,
    TestPlanned,
    TestRenamed,
    TestStarted,
)
from rtf.testing.verdict import ExitCode, FixtureState, Phase, Severity, Verdict

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping

#: So many failures of a test are kept; the journal has the rest.
_KEPT_MESSAGES = 50
#: A test with one of these verdicts has no result yet, and runs again when the run is resumed.
_OPEN = frozenset({None, Verdict.NOT_RUN, Verdict.INTERRUPTED, Verdict.BLOCKED})
_PROBLEMS = (Severity.FAILURE, Severity.ERROR)
_OF_TESTS = frozenset({Message, TestStarted, TestEnded, TestRenamed})
#: Events that are frequent and change no result.
_PASSED_OVER = frozenset({Measured, PhaseStarted, OutputCaptured, Progressed, SeriesSampled})


@dataclass(slots=True)
class TestResult:
    """The results of one test. Only what every report needs is kept, so that ten thousand tests stay small."""

    __test__ = False

    planned: TestPlanned
    name: str
    description: str = ""
    verdict: Verdict | None = None
    attempts: list[TestEnded] = field(default_factory=list)
    problems: list[Message] = field(default_factory=list)  # failures and errors of the last attempt
    problem_count: int = 0
    started: float | None = None
    running: bool = False
    cases: list[TestResult] = field(default_factory=list)  # of a program; each is a test of the run, too

    @property
    def id(self) -> str:
        """The stable id, ``suite/test``."""
        return self.planned.test

    @property
    def label(self) -> str:
        """The part of the id after the suite's."""
        return self.planned.test.removeprefix(f"{self.planned.suite}/")

    @property
    def good(self) -> bool:
        """Whether the test has ended well; a program only together with its cases."""
        return self.verdict is not None and self.verdict.good and all(case.good for case in self.cases)

    @property
    def last(self) -> TestEnded | None:
        """The end of the last attempt."""
        return self.attempts[-1] if self.attempts else None

    @property
    def duration(self) -> float:
        """Seconds over all attempts."""
        return sum(attempt.duration for attempt in self.attempts)

    def apply(self, event: Event) -> None:
        """Add an event of this test."""
        match event:
            case Message():
                if event.severity in _PROBLEMS:
                    self.problem_count += 1
                    if len(self.problems) < _KEPT_MESSAGES:
                        self.problems.append(event)
            case TestStarted():
                self.running, self.verdict = True, None
                self.started = event.time if self.started is None else self.started
                self.problems, self.problem_count = [], 0
            case TestEnded():
                self.running = False
                self.attempts.append(event)
                self.verdict = event.verdict if event.final else self.verdict
            case TestRenamed():
                self.name = event.name
                self.description = event.description or self.description


@dataclass(slots=True)
class SuiteResult:
    """The results of one suite, its fixtures' incidents included."""

    planned: SuitePlanned
    tests: dict[str, TestResult] = field(default_factory=dict)
    incidents: list[FixtureIncident] = field(default_factory=list)
    problems: list[Message] = field(default_factory=list)
    fixtures: dict[str, FixtureChanged] = field(default_factory=dict)
    started: float | None = None
    ended: SuiteEnded | None = None

    @property
    def id(self) -> str:
        """The stable id."""
        return self.planned.suite

    @property
    def name(self) -> str:
        """The name for people."""
        return self.planned.name

    def counts(self) -> Counter[Verdict]:
        """How many tests ended with each verdict; one that never ended counts as not run."""
        return Counter(test.verdict or Verdict.NOT_RUN for test in self.tests.values())

    def apply(self, event: Event) -> None:
        """Add an event of this suite."""
        match event:
            case SuitePlanned():  # a resumed run says its plan again
                self.planned, self.ended = event, None
                self.incidents.clear()
                self.fixtures.clear()
            case SuiteStarted():
                self.started = event.time
            case SuiteEnded():
                self.ended = event
            case FixtureChanged():
                self.fixtures[event.fixture] = event
            case FixtureIncident():
                self.incidents.append(event)
            case Message():
                if event.severity in _PROBLEMS and len(self.problems) < _KEPT_MESSAGES:
                    self.problems.append(event)


@dataclass(slots=True)
class RunResult:
    """The results of the run so far."""

    started: RunStarted | None = None
    ended: RunEnded | None = None
    suites: dict[str, SuiteResult] = field(default_factory=dict)
    tests: dict[str, TestResult] = field(default_factory=dict)
    diagnostics: list[Diagnosed] = field(default_factory=list)
    internal_errors: list[InternalError] = field(default_factory=list)
    interrupted: Interrupted | None = None

    @classmethod
    def of(cls, events: Iterable[Event]) -> Self:
        """Return the results of these events."""
        made = cls()
        for event in events:
            made.apply(event)
        return made

    def apply(self, event: Event) -> None:
        """Add one event. Events of tests that were never planned are ignored."""
        if type(event) in _OF_TESTS and event.test:  # type: ignore[attr-defined]  # these have a test
            test = self.tests.get(event.test)  # type: ignore[attr-defined]
            if test is not None:
                test.apply(event)
        elif type(event) not in _PASSED_OVER:
            self._apply(event)

    def _apply(self, event: Event) -> None:
        match event:
            case TestPlanned():
                self._plan_test(event)
            case SuitePlanned() if event.suite not in self.suites:
                self.suites[event.suite] = SuiteResult(event)
            case RunStarted():
                self.started, self.ended, self.interrupted = event, None, None
                self.internal_errors.clear()
                for test in self.tests.values():  # the test during which the earlier part was killed
                    test.running = False
            case PlanChanged():
                self._drop((*event.removed, *event.changed))
            case Diagnosed():
                self.diagnostics.append(event)
            case InternalError():
                self.internal_errors.append(event)
            case Interrupted():
                self.interrupted = event
            case RunEnded():
                self.ended = event
            case _:
                suite = self.suites.get(getattr(event, "suite", ""))
                if suite is not None:
                    suite.apply(event)

    def _plan_test(self, event: TestPlanned) -> None:
        if event.test in self.tests:
            return
        program = self.tests.get(event.parent)
        result = self.tests[event.test] = TestResult(event, event.name)
        if program is not None and not program.planned.parent:  # a case has none; in a damaged journal it may
            program.cases.append(result)
        suite = self.suites.get(event.suite)
        if suite is not None:
            suite.tests[event.test] = result

    def _drop(self, ids: Iterable[str]) -> None:
        """Remove these suites, tests and their cases, which the run does not have any more, or which have changed."""
        for gone in self.with_cases(ids):
            self.suites.pop(gone, None)
            suite = self.suite_of(gone)
            if suite is not None:
                suite.tests.pop(gone, None)
            self.tests.pop(gone, None)

    def with_cases(self, ids: Iterable[str]) -> list[str]:
        """Return these suites and tests, and the cases of those that are programs."""
        named = [*ids]
        return [*named, *(case.id for test in named if test in self.tests for case in self.tests[test].cases)]

    def counts(self) -> Counter[Verdict]:
        """How many tests ended with each verdict."""
        return Counter(test.verdict or Verdict.NOT_RUN for test in self.tests.values())

    def suite_of(self, test: str) -> SuiteResult | None:
        """Return the suite of a test, or None."""
        result = self.tests.get(test)
        return None if result is None else self.suites.get(result.planned.suite)

    def exit_code(self, *, allow_empty: bool = False) -> ExitCode:
        """Return the exit code of the run."""
        counts = self.counts()
        suites = self.suites.values()
        if self.internal_errors:
            return ExitCode.INTERNAL
        if self.interrupted is not None:
            return ExitCode.INTERRUPTED
        if any(fixture.state is FixtureState.FAILED for suite in suites for fixture in suite.fixtures.values()):
            return ExitCode.FIXTURE
        if any(not verdict.good for verdict in counts) or any(suite.problems for suite in suites):
            return ExitCode.FAILURES
        if any(incident.phase is Phase.TEARDOWN for suite in suites for incident in suite.incidents):
            return ExitCode.FAILURES
        ran = sum(count for verdict, count in counts.items() if verdict.ran)
        return ExitCode.PASSED if ran or allow_empty else ExitCode.NOTHING_RAN

    def verdict(self, *, allow_empty: bool = False) -> Verdict:
        """Return the verdict of the run."""
        return _RUN_VERDICTS[self.exit_code(allow_empty=allow_empty)]

    # For a run that is resumed -----------------------------------------------------------------------------------

    @property
    def plan_is_whole(self) -> bool:
        """Whether all tests of the run are known: they are planned before the first suite starts."""
        return any(suite.started is not None for suite in self.suites.values())

    def finished(self) -> frozenset[str]:
        """Return the tests whose verdict is final. That of a case is final with its program's."""
        stands = {test.id for test in self.tests.values() if test.verdict not in _OPEN}
        cases = {test.id: test.planned.parent for test in self.tests.values() if test.planned.parent}
        return frozenset(test for test in stands if cases.get(test, test) in stands)

    def programs(self) -> frozenset[str]:
        """Return the planned tests, without the cases that programs have reported."""
        return frozenset(test.id for test in self.tests.values() if not test.planned.parent)

    def limited(self) -> dict[str, dict[str, str]]:
        """Return, for each program that was to run some cases only, the names of these by their ids."""
        tests = self.tests
        return {
            test.id: {case: tests[case].planned.case if case in tests else "" for case in test.planned.cases}
            for test in tests.values()
            if test.planned.cases
        }

    def plan_changes(self, suites: Collection[str], fingerprints: Mapping[str, str]) -> PlanChanged | None:
        """Return how the plan differs from the present suites and tests; None if it does not."""
        planned = {test.id: test.planned.fingerprint for test in self.tests.values() if not test.planned.parent}
        added = [test for test in fingerprints if test not in planned and self.plan_is_whole]
        removed = [*planned.keys() - fingerprints.keys(), *self.suites.keys() - set(suites)]
        changed = [
            test
            for test, fingerprint in planned.items()
            if fingerprint and fingerprints.get(test, fingerprint) != fingerprint
        ]
        if not (added or removed or changed):
            return None
        return PlanChanged(added=tuple(added), removed=tuple(sorted(removed)), changed=tuple(changed))


_RUN_VERDICTS = {
    ExitCode.PASSED: Verdict.PASSED,
    ExitCode.FAILURES: Verdict.FAILED,
    ExitCode.INTERRUPTED: Verdict.INTERRUPTED,
    ExitCode.INTERNAL: Verdict.ERROR,
    ExitCode.USAGE: Verdict.ERROR,
    ExitCode.NOTHING_RAN: Verdict.NOT_RUN,
    ExitCode.FIXTURE: Verdict.BLOCKED,
}
