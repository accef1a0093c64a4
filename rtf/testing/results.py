"""Verdicts and counts of a run, folded from its events: whoever has the events has the results."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from rtf.testing.events import (
    Diagnosed,
    Event,
    FixtureChanged,
    FixtureIncident,
    InternalError,
    Interrupted,
    Measured,
    Message,
    RunEnded,
    RunStarted,
    SubResultEnded,
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
    from collections.abc import Callable

#: A test that fails more often than this has said what it has to say; the journal has the rest.
_KEPT_MESSAGES = 50


@dataclass(slots=True)
class TestResult:
    """What is known of one test. Only what every report needs is kept, so that ten thousand tests stay small."""

    __test__ = False

    planned: TestPlanned
    name: str
    description: str = ""
    verdict: Verdict | None = None
    attempts: list[TestEnded] = field(default_factory=list)
    problems: list[Message] = field(default_factory=list)  # failures and errors of the last attempt
    problem_count: int = 0
    parts: dict[str, Verdict] = field(default_factory=dict)  # sub-results of the last attempt
    measured: int = 0
    started: float | None = None
    running: bool = False
    cases: list[TestResult] = field(default_factory=list)  # of a program; each is a test of the run, too

    @property
    def id(self) -> str:
        """The stable id, ``suite/test``."""
        return self.planned.test

    @property
    def label(self) -> str:
        """The part of the id behind the suite's."""
        return self.planned.test.removeprefix(f"{self.planned.suite}/")

    @property
    def good(self) -> bool:
        """Whether it has ended well; a program only together with its cases."""
        return self.verdict is not None and self.verdict.good and all(case.good for case in self.cases)

    @property
    def last(self) -> TestEnded | None:
        """The end of the last attempt."""
        return self.attempts[-1] if self.attempts else None

    @property
    def duration(self) -> float:
        """Seconds over all attempts."""
        return sum(attempt.duration for attempt in self.attempts)


@dataclass(slots=True)
class SuiteResult:
    """What is known of one suite, its fixtures' incidents included."""

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


@dataclass(slots=True)
class RunResult:
    """What is known of the run so far."""

    started: RunStarted | None = None
    ended: RunEnded | None = None
    suites: dict[str, SuiteResult] = field(default_factory=dict)
    tests: dict[str, TestResult] = field(default_factory=dict)
    diagnostics: list[Diagnosed] = field(default_factory=list)
    internal_errors: list[InternalError] = field(default_factory=list)
    interrupted: Interrupted | None = None

    def apply(self, event: Event) -> None:
        """Take one more event in. Events of tests that were never planned are passed over."""
        handler = _HANDLERS.get(type(event))
        if handler is not None:
            handler(self, event)

    def counts(self) -> Counter[Verdict]:
        """How many tests ended with each verdict."""
        return Counter(test.verdict or Verdict.NOT_RUN for test in self.tests.values())

    def suite_of(self, test: str) -> SuiteResult | None:
        """The suite that a test belongs to."""
        result = self.tests.get(test)
        return None if result is None else self.suites.get(result.planned.suite)

    def exit_code(self, *, allow_empty: bool = False) -> ExitCode:
        """The one number that a shell or a CI server reads."""
        counts = self.counts()
        if self.internal_errors:
            return ExitCode.INTERNAL
        if self.interrupted is not None:
            return ExitCode.INTERRUPTED
        if self._fixture_unusable():
            return ExitCode.FIXTURE
        if any(not verdict.good for verdict in counts):
            return ExitCode.FAILURES
        if any(suite.problems or self._teardown_problem(suite) for suite in self.suites.values()):
            return ExitCode.FAILURES
        ran = sum(count for verdict, count in counts.items() if verdict.ran)
        return ExitCode.PASSED if ran or allow_empty else ExitCode.NOTHING_RAN

    def _fixture_unusable(self) -> bool:
        return any(
            changed.state is FixtureState.FAILED
            for suite in self.suites.values()
            for changed in suite.fixtures.values()
        )

    @staticmethod
    def _teardown_problem(suite: SuiteResult) -> bool:
        return any(incident.phase is Phase.TEARDOWN for incident in suite.incidents)

    def verdict(self, *, allow_empty: bool = False) -> Verdict:
        """The run in one word."""
        return _RUN_VERDICTS[self.exit_code(allow_empty=allow_empty)]

    # One method per event ----------------------------------------------------------------------------------------

    def _run_started(self, event: RunStarted) -> None:
        self.started = event
        self.ended = None
        self.interrupted = None
        self.internal_errors.clear()

    def _suite_planned(self, event: SuitePlanned) -> None:
        known = self.suites.get(event.suite)
        if known is None:
            self.suites[event.suite] = SuiteResult(event)
        else:  # a resumed run says its plan again
            known.planned = event
            known.ended = None
            known.incidents.clear()
            known.fixtures.clear()

    def _test_planned(self, event: TestPlanned) -> None:
        if event.test in self.tests:
            return
        program = self.tests.get(event.parent)
        result = self.tests[event.test] = TestResult(event, event.name)
        if program is not None and not program.planned.parent:  # a case has none; in a damaged journal it may
            program.cases.append(result)
        suite = self.suites.get(event.suite)
        if suite is not None:
            suite.tests[event.test] = result

    def _suite_started(self, event: SuiteStarted) -> None:
        suite = self.suites.get(event.suite)
        if suite is not None:
            suite.started = event.time

    def _suite_ended(self, event: SuiteEnded) -> None:
        suite = self.suites.get(event.suite)
        if suite is not None:
            suite.ended = event

    def _fixture_changed(self, event: FixtureChanged) -> None:
        suite = self.suites.get(event.suite)
        if suite is not None:
            suite.fixtures[event.fixture] = event

    def _fixture_incident(self, event: FixtureIncident) -> None:
        suite = self.suites.get(event.suite)
        if suite is not None:
            suite.incidents.append(event)

    def _test_started(self, event: TestStarted) -> None:
        test = self.tests.get(event.test)
        if test is not None:
            test.running = True
            test.verdict = None
            test.started = event.time if test.started is None else test.started
            test.problems = []
            test.problem_count = 0
            test.parts = {}

    def _test_renamed(self, event: TestRenamed) -> None:
        test = self.tests.get(event.test)
        if test is not None:
            test.name = event.name
            test.description = event.description or test.description

    def _message(self, event: Message) -> None:
        if event.severity not in (Severity.FAILURE, Severity.ERROR):
            return
        test = self.tests.get(event.test)
        if test is not None:
            test.problem_count += 1
            if len(test.problems) < _KEPT_MESSAGES:
                test.problems.append(event)
        elif event.suite in self.suites and not event.test:
            problems = self.suites[event.suite].problems
            if len(problems) < _KEPT_MESSAGES:
                problems.append(event)

    def _measured(self, event: Measured) -> None:
        test = self.tests.get(event.test)
        if test is not None:
            test.measured += 1

    def _subresult_ended(self, event: SubResultEnded) -> None:
        test = self.tests.get(event.test)
        if test is not None and len(test.parts) < 10 * _KEPT_MESSAGES:
            test.parts[event.subject] = event.verdict

    def _test_ended(self, event: TestEnded) -> None:
        test = self.tests.get(event.test)
        if test is not None:
            test.running = False
            test.attempts.append(event)
            if event.final:
                test.verdict = event.verdict

    def _interrupted(self, event: Interrupted) -> None:
        self.interrupted = event

    def _diagnosed(self, event: Diagnosed) -> None:
        self.diagnostics.append(event)

    def _internal_error(self, event: InternalError) -> None:
        self.internal_errors.append(event)

    def _run_ended(self, event: RunEnded) -> None:
        self.ended = event


_HANDLERS: dict[type[Event], Callable[[RunResult, Any], None]] = {
    RunStarted: RunResult._run_started,  # noqa: SLF001 - a dispatch table of its own class
    SuitePlanned: RunResult._suite_planned,  # noqa: SLF001
    TestPlanned: RunResult._test_planned,  # noqa: SLF001
    SuiteStarted: RunResult._suite_started,  # noqa: SLF001
    SuiteEnded: RunResult._suite_ended,  # noqa: SLF001
    FixtureChanged: RunResult._fixture_changed,  # noqa: SLF001
    FixtureIncident: RunResult._fixture_incident,  # noqa: SLF001
    TestStarted: RunResult._test_started,  # noqa: SLF001
    TestRenamed: RunResult._test_renamed,  # noqa: SLF001
    Message: RunResult._message,  # noqa: SLF001
    Measured: RunResult._measured,  # noqa: SLF001
    SubResultEnded: RunResult._subresult_ended,  # noqa: SLF001
    TestEnded: RunResult._test_ended,  # noqa: SLF001
    Interrupted: RunResult._interrupted,  # noqa: SLF001
    Diagnosed: RunResult._diagnosed,  # noqa: SLF001
    InternalError: RunResult._internal_error,  # noqa: SLF001
    RunEnded: RunResult._run_ended,  # noqa: SLF001
}

_RUN_VERDICTS = {
    ExitCode.PASSED: Verdict.PASSED,
    ExitCode.FAILURES: Verdict.FAILED,
    ExitCode.INTERRUPTED: Verdict.INTERRUPTED,
    ExitCode.INTERNAL: Verdict.ERROR,
    ExitCode.USAGE: Verdict.ERROR,
    ExitCode.NOTHING_RAN: Verdict.NOT_RUN,
    ExitCode.FIXTURE: Verdict.BLOCKED,
}
