"""The thread that calls reporters: calls have a limit and an order, and updates a share of time."""

from __future__ import annotations

import resource
import threading
from pathlib import Path

import pytest

from rtf.testing import reporter_thread
from rtf.testing.events import Event, SuiteStarted, TestEnded
from rtf.testing.reporter_thread import ReporterThread, bounded, let_linger
from rtf.testing.reporting import Reporter, ReportOptions
from rtf.testing.results import RunResult
from rtf.testing.verdict import Verdict
from tests.waiting import eventually


class Hearing(Reporter):
    """A reporter that keeps its events and counts its updates."""

    plugin_name = "hearing"

    def __init__(self) -> None:
        super().__init__(ReportOptions(None, Path()))
        self.heard: list[Event] = []
        self.updates = 0

    def handle(self, event: Event, results: RunResult) -> None:
        self.heard.append(event)

    def update(self, results: RunResult) -> None:
        self.updates += 1


class Hanging(Hearing):
    """A reporter that hangs in its second event."""

    plugin_name = "hanging"
    patience = 0.2

    def handle(self, event: Event, results: RunResult) -> None:
        super().handle(event, results)
        if len(self.heard) == 2:
            threading.Event().wait()


@pytest.fixture
def broken() -> list[tuple[Reporter, BaseException]]:
    """The reporters that failed, with their errors."""
    return []


def thread_of(broken: list[tuple[Reporter, BaseException]], *reporters: Reporter) -> ReporterThread:
    """Return a thread that calls these reporters in a running run."""
    thread = ReporterThread(reporters, lambda reporter, error: broken.append((reporter, error)))
    thread.live = True
    return thread


def test_the_others_hear_each_event_once_when_one_hangs(broken: list[tuple[Reporter, BaseException]]):
    """If a reporter hangs, the others get each event once."""
    before, hanging, behind = Hearing(), Hanging(), Hearing()
    thread = thread_of(broken, before, hanging, behind)
    events = [SuiteStarted(suite=f"s{number}") for number in range(4)]
    for event in events:
        thread.put(event)
    eventually(lambda: before.heard == behind.heard == events, "the others do not hear of everything")
    assert hanging.heard == events[:2]
    ((who, error),) = broken
    assert (who, str(error)) == (hanging, "handle() did not return within 0.2 s")
    thread.close(lambda: 0)


def test_an_expensive_report_is_brought_up_to_date_less_often(broken: list[tuple[Reporter, BaseException]]):
    """A report whose update takes long is updated rarely, without delaying others."""

    class Expensive(Hearing):
        def update(self, results: RunResult) -> None:
            super().update(results)
            began = resource.getrusage(resource.RUSAGE_THREAD).ru_utime
            while resource.getrusage(resource.RUSAGE_THREAD).ru_utime < began + 0.1:
                pass

    cheap, expensive = Hearing(), Expensive()
    thread = thread_of(broken, cheap, expensive)
    thread.put(SuiteStarted(suite="s"))

    def updated_often() -> bool:
        thread.put(SuiteStarted(suite="s"))
        return cheap.updates >= 4

    eventually(updated_often, "the report is not brought up to date each second", limit=20.0)
    assert expensive.updates == 2
    thread.close(lambda: 0)
    assert broken == []


def test_the_first_test_is_in_the_reports_as_soon_as_it_has_ended(
    broken: list[tuple[Reporter, BaseException]], monkeypatch: pytest.MonkeyPatch
):
    """Reports are updated after the first test, and then periodically."""
    monkeypatch.setattr(reporter_thread, "PAUSE", 1000.0)
    reporter = Hearing()
    thread = thread_of(broken, reporter)
    thread.put(SuiteStarted(suite="s"))
    eventually(lambda: reporter.updates == 1, "the report is not written")
    thread.put(TestEnded(test="s/a", verdict=Verdict.PASSED, outcome=Verdict.PASSED))
    eventually(lambda: reporter.updates == 2, "the end of the first test is not in the report")
    thread.put(TestEnded(test="s/b", verdict=Verdict.PASSED, outcome=Verdict.PASSED))
    thread.flush(lambda: 0)
    assert reporter.updates == 2
    thread.close(lambda: 0)


def test_a_report_that_is_up_to_date_is_not_written_again(broken: list[tuple[Reporter, BaseException]]):
    """A report is not updated without new events."""
    reporter, other = Hearing(), Hearing()
    thread = thread_of(broken, reporter, other)
    thread.put(SuiteStarted(suite="s"))
    eventually(lambda: other.updates == 1, "the report is not written")
    thread.flush(lambda: 0)
    assert reporter.updates == 1
    thread.close(lambda: 0)


def test_answers_and_errors_of_a_bounded_call_come_back():
    """A limited call returns the result, or raises the error."""

    class Refusing(Hearing):
        def open(self) -> None:
            raise OSError("no room")

    assert bounded(Hearing(), "paths") == ()
    with pytest.raises(OSError, match="no room"):
        bounded(Refusing(), "open")


def test_what_goes_wrong_while_reporters_linger_is_given_back():
    """An error of a reporter that lingers is returned, and the others go on."""

    class Leaving(Hearing):
        def linger(self, stop: threading.Event) -> None:
            raise RuntimeError("gone")

    class Staying(Hearing):
        stays = True

        def linger(self, stop: threading.Event) -> None:
            stop.set()  # as a signal would do it
            self.updates += 1

    leaving, staying = Leaving(), Staying()
    ((who, error),) = let_linger([leaving, staying], threading.Event())
    assert (who, str(error), staying.updates) == (leaving, "gone", 1)


@pytest.mark.parametrize(("asked", "limit"), [([1], 0.3), ([0, 1], 0.1)])
def test_a_run_that_is_to_stop_waits_less_for_its_reports(
    broken: list[tuple[Reporter, BaseException]], monkeypatch: pytest.MonkeyPatch, asked: list[int], limit: float
):
    """A stopped run waits less for its reports, and least after another stop."""
    monkeypatch.setattr(reporter_thread, "STOPPING_LIMIT", 0.3)
    monkeypatch.setattr(reporter_thread, "HURRIED_LIMIT", 0.1)

    class Endless(Hearing):
        def close(self, results: RunResult) -> None:
            threading.Event().wait()

    thread = thread_of(broken, Endless())
    thread.close(lambda: asked.pop(0) if len(asked) > 1 else asked[0])
    assert [str(error) for _, error in broken] == [f"close() did not return within {limit:g} s"]


def test_a_thread_that_is_about_to_start_is_waited_for(
    broken: list[tuple[Reporter, BaseException]], monkeypatch: pytest.MonkeyPatch
):
    """A report is closed, though the thread that is to do it is slow to start after another one has hung."""
    monkeypatch.setattr(reporter_thread, "_WATCH", 0.05)
    starting, go_on = threading.Event(), threading.Event()
    start = threading.Thread.start

    def start_slowly(thread: threading.Thread) -> None:
        if thread.name == "rtf-reports" and threading.current_thread().name == "rtf-reports-watch":
            starting.set()
            go_on.wait()
        start(thread)

    class Waited(ReporterThread):
        def _leave_what_hangs(self) -> None:
            if threading.current_thread() is threading.main_thread():  # it waits for the reporters
                go_on.set()
            super()._leave_what_hangs()

    class Closing(Hearing):
        closed = False

        def close(self, results: RunResult) -> None:
            self.closed = True

    monkeypatch.setattr(threading.Thread, "start", start_slowly)
    closing = Closing()
    thread = Waited([closing, Hanging()], lambda reporter, error: broken.append((reporter, error)))
    for _ in range(2):
        thread.put(SuiteStarted(suite="s"))
    assert starting.wait(10.0)
    thread.close(lambda: 0)
    go_on.set()
    assert closing.closed
