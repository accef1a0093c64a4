"""Runs written by hand: events as a runner would emit them, given to reporters as a runner gives them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from msgspec.structs import replace

from rtf.testing.broadcast import Broadcast
from rtf.testing.events import (
    Event,
    FixtureChanged,
    FixtureIncident,
    Message,
    RunEnded,
    RunStarted,
    SuiteEnded,
    SuitePlanned,
    SuiteStarted,
    TestEnded,
    TestPlanned,
    TestStarted,
)
from rtf.testing.journal import FILE_NAME, Journal
from rtf.testing.reporting import ReportOptions, load_reporter
from rtf.testing.results import RunResult
from rtf.testing.verdict import FixtureState, Phase, Severity, Verdict

if TYPE_CHECKING:
    from pathlib import Path


class Story:
    """Collects events; each happens half a second after the one before."""

    def __init__(self) -> None:
        self.events: list[Event] = []
        self._time = 1_750_000_000.0

    def add(self, *events: Event) -> Story:
        """Append events, at their times."""
        for event in events:
            self._time += 0.5
            self.events.append(replace(event, time=self._time))
        return self

    def begin(self, *suites: tuple[str, int], robot: str = "icubSim", fixtures: tuple[str, ...] = ()) -> Story:
        """Begin a run, and plan suites with so many tests, named ``t1`` and so on."""
        self.add(RunStarted(run="run-1", version="0.1", robot=robot, environment={"host": "bench"}, command=("rtf",)))
        for suite, count in suites:
            self.add(SuitePlanned(suite=suite, name=suite, file="/lab/suites/arm.xml", fixtures=fixtures))
            for number in range(1, count + 1):
                self.add(self.planned(suite, f"t{number}", line=number))
        return self

    def planned(self, suite: str, name: str, **more: Any) -> TestPlanned:
        """Return the event that plans a test."""
        more = {"file": "/lab/suites/arm.xml", "plugin": "reach", **more}
        return TestPlanned(test=f"{suite}/{name}", suite=suite, name=name, **more)

    def start(self, suite: str) -> Story:
        """Start a suite."""
        return self.add(SuiteStarted(suite=suite))

    def test(
        self,
        test: str,
        verdict: Verdict = Verdict.PASSED,
        *said: Event,
        outcome: Verdict | None = None,
        attempt: int = 1,
        final: bool = True,
        **more: Any,
    ) -> Story:
        """Add one attempt at a test, with the events that come out of it."""
        if attempt:
            self.add(TestStarted(test=test, attempt=attempt, pid=4711))
        self.add(*said)
        more = {"duration": 0.25, **more}
        return self.add(
            TestEnded(test=test, verdict=verdict, outcome=outcome or verdict, attempt=attempt, final=final, **more),
        )

    def failing(self, test: str, detail: str = "too far", **more: Any) -> Story:
        """Add a test that fails one check."""
        return self.test(test, Verdict.FAILED, failure(test, detail), detail=detail, reason="failure", **more)

    def fixture(self, suite: str, name: str, state: FixtureState, generation: int = 1, detail: str = "") -> Story:
        """Add a change of a fixture's state."""
        return self.add(
            FixtureChanged(fixture=name, suite=suite, state=state, generation=generation, detail=detail, pid=99),
        )

    def incident(self, suite: str, name: str, cause: str = "the program died", **more: Any) -> Story:
        """Add an incident of a fixture."""
        more = {"phase": Phase.CHECK, "generation": 1, "signal": "SIGSEGV", "output": "last\nwords\n", **more}
        return self.add(FixtureIncident(fixture=name, suite=suite, cause=cause, **more))

    def end(self, suite: str, verdict: Verdict = Verdict.PASSED) -> Story:
        """End a suite."""
        return self.add(SuiteEnded(suite=suite, verdict=verdict, duration=3.5))

    def finish(self, exit_code: int | None = None) -> Story:
        """End the run, with the exit code that its results give if ``exit_code`` is None."""
        results = RunResult()
        for event in self.events:
            results.apply(event)
        code = int(results.exit_code()) if exit_code is None else exit_code
        return self.add(RunEnded(verdict=results.verdict(), exit_code=code, duration=12.5))


def failure(test: str, detail: str = "too far", **more: Any) -> Message:
    """Return the message of a failed check."""
    more = {"file": "/lab/reach.py", "line": 12, "traceback": "Traceback (most recent call last)\n", **more}
    return Message(severity=Severity.FAILURE, title="checks", detail=detail, test=test, **more)


class Reports:
    """Gives a story to reporters."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.results = RunResult()
        self.broadcast = Broadcast(None, [])

    def __call__(self, name: str, story: Story, *, close: bool = True, **options: Any) -> Path:
        """Give a story to one reporter and return its file; with ``close=False`` the reporter stays open.

        With ``journal`` the run has one, as all real runs have.
        """
        cls = load_reporter(name)
        target = options.pop("target", self.folder / (cls.default_file or "none"))
        run_folder = options.pop("run_folder", self.folder)
        written = Journal(run_folder / FILE_NAME) if options.pop("journal", False) else None
        reporter = cls(ReportOptions(target, run_folder, **options))
        reporter.open()
        broadcast = self.broadcast = Broadcast(written, [reporter])
        self.results = broadcast.results
        for event in story.events:
            broadcast.emit(event)
        broadcast.flush()
        if close:
            broadcast.close()
        broken = [error for error in broadcast.results.internal_errors if "left out" in error.text]
        assert not broken
        return target


@pytest.fixture
def story() -> Story:
    """An empty story."""
    return Story()


@pytest.fixture
def reports(tmp_path: Path) -> Reports:
    """Reporters that write below the test's own folder."""
    return Reports(tmp_path)


@pytest.fixture
def check_failed() -> Any:
    """Makes the message of a failed check."""
    return failure
