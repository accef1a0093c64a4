"""A journal read as one run: void events are omitted, and an incomplete run gets its ends."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from rtf.testing import journal
from rtf.testing.events import (
    Event,
    FixtureIncident,
    InternalError,
    Interrupted,
    Message,
    PlanChanged,
    RunEnded,
    RunStarted,
    SuiteEnded,
    SuitePlanned,
    SuiteStarted,
    TestEnded,
    TestPlanned,
    TestStarted,
    to_line,
)
from rtf.testing.results import RunResult
from rtf.testing.verdict import ExitCode, Phase, Severity, Verdict

Writer = Callable[..., Path]

PLAN = [
    RunStarted(run="r", version="1", time=1.0),
    SuitePlanned(suite="s", name="s"),
    TestPlanned(test="s/a", suite="s", name="a"),
    TestPlanned(test="s/b", suite="s", name="b"),
    SuiteStarted(suite="s"),
]
AGAIN = [RunStarted(run="r", version="1", resumed=True, time=2.0), SuiteStarted(suite="s")]
CUT = [Interrupted(source="x", stage=2), SuiteEnded(suite="s", verdict=Verdict.FAILED, duration=1)]
OVER = RunEnded(verdict=Verdict.INTERRUPTED, exit_code=2, duration=1)


def ran(test: str, verdict: Verdict = Verdict.PASSED, words: str = "") -> list[Event]:
    """Return the events of a finished test."""
    said = Message(severity=Severity.INFO, title="reports", detail=words or test, test=test)
    return [TestStarted(test=test, time=5.0), said, TestEnded(test=test, verdict=verdict, outcome=verdict, time=6.0)]


@pytest.fixture
def write(tmp_path: Path):
    """Return a function that writes a journal of these events."""

    def put(*events: Event) -> Path:
        path = tmp_path / journal.FILE_NAME
        path.write_bytes(b"".join(to_line(event) for event in events))
        return path

    return put


@pytest.mark.parametrize(
    ("verdict", "stands"),
    [(verdict, verdict not in (Verdict.NOT_RUN, Verdict.INTERRUPTED, Verdict.BLOCKED)) for verdict in Verdict],
)
def test_finished_is_what_has_said_something(verdict: Verdict, stands: bool):
    """A test that was not run, interrupted or blocked is not finished."""
    assert RunResult.of([*PLAN, *ran("s/a", verdict)]).finished() == ({"s/a"} if stands else set())


def test_test_that_was_started_again_is_not_finished():
    """A later start makes an earlier end void."""
    assert RunResult.of([*PLAN, *ran("s/a"), TestStarted(test="s/a")]).finished() == set()
    retried = TestEnded(test="s/a", verdict=Verdict.FAILED, outcome=Verdict.FAILED, final=False)
    assert RunResult.of([*PLAN, TestStarted(test="s/a"), retried]).finished() == set()


def test_what_was_removed_or_changed_before_a_later_part_is_void(write: Writer):
    """Events of removed tests, and earlier ones of changed tests, are void; so are removed suites."""
    gone = SuitePlanned(suite="t", name="t")
    again = TestPlanned(test="s/b", suite="s", name="b", fingerprint="2")
    path = write(
        *(*PLAN[:-1], gone, PLAN[-1], *ran("s/a"), *ran("s/b", words="before"), *CUT, OVER, AGAIN[0]),
        *(PlanChanged(removed=("s/a", "t"), changed=("s/b",)), again, AGAIN[1], *ran("s/b", words="after"), OVER),
    )
    results = journal.results_of(path)
    assert [*results.suites] == ["s"]
    assert {test.planned.fingerprint for test in results.tests.values()} == {"2"}
    assert "before" not in {event.detail for event in journal.as_one_run(path) if isinstance(event, Message)}
    assert RunResult.of(journal.read(path)).tests.keys() == results.tests.keys() == results.finished() == {"s/b"}


def test_run_that_was_not_resumed_is_as_it_was(write: Writer):
    """A run of one part is read unchanged."""
    events = [*PLAN, *ran("s/a"), *ran("s/b", Verdict.FAILED), *CUT, OVER]
    assert [*journal.as_one_run(write(*events))] == events


def test_parts_of_a_resumed_run_are_one_run(write: Writer):
    """Ends of earlier parts, and events of tests that ran again, are omitted."""
    lost = ran("s/b", Verdict.INTERRUPTED, "first try")
    path = write(*PLAN, *ran("s/a"), *lost, *CUT, OVER, *AGAIN, *ran("s/b", words="second try"), OVER)
    events = [*journal.as_one_run(path)]
    assert [event.kind for event in events].count("run_ended") == 1
    assert [event.kind for event in events].count("run_started") == 1
    assert [event.kind for event in events].count("suite_started") == 1
    assert [event.detail for event in events if isinstance(event, Message)] == ["s/a", "second try"]
    results = RunResult.of(events)
    assert {test.verdict for test in results.tests.values()} == {Verdict.PASSED}
    assert results.interrupted is None


def test_run_that_is_being_resumed_keeps_what_is_finished_only(write: Writer):
    """While a run is resumed, only finished tests of earlier parts count."""
    path = write(*PLAN, *ran("s/a"), TestStarted(test="s/b"))
    results = RunResult.of(journal.as_one_run(path, resuming=True))
    assert {test.id: test.verdict for test in results.tests.values()} == {"s/a": Verdict.PASSED, "s/b": None}
    assert not results.tests["s/b"].running


def test_run_that_was_resumed_twice(write: Writer):
    """Of a run that was resumed twice each test has its last result."""
    path = write(
        *PLAN,
        *ran("s/a"),
        TestStarted(test="s/b"),
        *AGAIN,
        TestStarted(test="s/b"),
        *AGAIN,
        *ran("s/b", Verdict.FAILED),
        OVER,
    )
    results = journal.results_of(path)
    assert {test.id: test.verdict for test in results.tests.values()} == {"s/a": Verdict.PASSED, "s/b": Verdict.FAILED}
    assert len(results.tests["s/b"].attempts) == 1


def test_incident_between_tests_is_never_lost(write: Writer):
    """Incidents of earlier parts are kept."""
    incident = FixtureIncident(fixture="rig", suite="s", generation=1, phase=Phase.CHECK, cause="x")
    path = write(*PLAN, *ran("s/a"), incident, *AGAIN, *ran("s/b"), OVER)
    assert len(journal.results_of(path).suites["s"].incidents) == 1


def test_journal_that_just_stops_gets_its_ends(write: Writer):
    """A journal without an end gets one: the run and its running test are interrupted."""
    path = write(*PLAN, *ran("s/a"), TestStarted(test="s/b", time=9.0))
    results = journal.results_of(path)
    assert {test.id: test.verdict for test in results.tests.values()} == {
        "s/a": Verdict.PASSED,
        "s/b": Verdict.INTERRUPTED,
    }
    assert results.tests["s/b"].last.detail == "the runner was killed while this test was running"
    assert results.exit_code() is ExitCode.INTERRUPTED


def test_journal_that_was_closed_in_order_gets_nothing(write: Writer):
    """A journal with an end gets none, also if errors follow it."""
    events = [*PLAN, *ran("s/a"), *ran("s/b"), OVER, InternalError(text="reporter x broke")]
    assert [*journal.as_one_run(write(*events))] == events
    assert [*journal.as_one_run(write())] == []


def test_a_plan_that_was_cut_off_selects_nothing():
    """A plan that was cut off does not select tests; the command line does."""
    assert not RunResult.of(PLAN[:3]).plan_is_whole
    whole = RunResult.of([*PLAN[:4], SuiteStarted(suite="s")])
    assert whole.plan_is_whole
    assert whole.tests.keys() == {"s/a", "s/b"}
