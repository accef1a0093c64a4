"""The reporter of the plug-in: it collects the events of each test, and the incidents of fixtures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf.testing.events import Event, FixtureIncident, InternalError, Message
from rtf.testing.report.files import AttemptEvents, TestEvents
from rtf.testing.reporting import Reporter
from rtf.testing.verdict import Phase, Severity, Verdict

if TYPE_CHECKING:
    from rtf.testing.events import TestEnded
    from rtf.testing.reporting import ReportOptions
    from rtf.testing.results import RunResult, TestResult


@dataclass(frozen=True, slots=True)
class FinishedTest:
    """What is known of a test that has ended; ``incidents`` are those of fixtures since the test before it."""

    result: TestResult
    ended: TestEnded
    attempts: list[AttemptEvents]
    incidents: tuple[FixtureIncident, ...]

    @property
    def bad_cases(self) -> list[TestResult]:
        """The cases of a program that did not pass. pytest has collected the program only, and reports them with it."""
        return [case for case in self.result.cases if not case.good]

    @property
    def verdict(self) -> Verdict:
        """The verdict of the test; that of a program includes its cases."""
        if self.ended.verdict.good and self.bad_cases:
            return Verdict.FAILED
        return self.ended.verdict

    @property
    def last(self) -> AttemptEvents:
        """The last attempt, or an empty one if the test was never started."""
        return next((attempt for attempt in reversed(self.attempts) if attempt.started), AttemptEvents())

    @property
    def earlier(self) -> list[AttemptEvents]:
        """The attempts before the last one."""
        return [attempt for attempt in self.attempts if attempt.started][:-1]


class Listener(Reporter):
    """Collects the events of each test until its report is made. The run's thread writes, pytest's thread reads."""

    plugin_name = "pytest"

    def __init__(self, options: ReportOptions) -> None:
        super().__init__(options)
        self._events = TestEvents()
        self._ended: dict[str, tuple[TestResult, list[AttemptEvents]]] = {}
        self._incidents: list[FixtureIncident] = []
        self._suite_problems: list[FixtureIncident | Message] = []
        self.broken: list[InternalError] = []

    def handle(self, event: Event, results: RunResult) -> None:
        """Collect one event."""
        attempts = self._events.take(event)
        if attempts is not None:
            result = results.tests[event.test]  # type: ignore[attr-defined]
            if not result.planned.parent:
                self._ended[result.id] = (result, attempts)
        elif isinstance(event, FixtureIncident):
            if event.phase is Phase.TEARDOWN:
                self._suite_problems.append(event)
            else:
                self._incidents.append(event)
        elif isinstance(event, Message) and not event.test and event.severity in (Severity.FAILURE, Severity.ERROR):
            self._suite_problems.append(event)
        elif isinstance(event, InternalError):
            self.broken.append(event)

    def take_test(self, test: str) -> FinishedTest | None:
        """Return what was collected of a test, and forget it."""
        result, attempts = self._ended.pop(test, (None, []))
        if result is None or result.last is None:
            return None
        incidents, self._incidents = self._incidents, []
        return FinishedTest(result, result.last, attempts, tuple(incidents))

    def take_suite_problems(self) -> list[FixtureIncident | Message]:
        """Return the problems of a suite and its fixtures outside of tests since the last call."""
        problems, self._suite_problems = self._suite_problems, []
        return problems
