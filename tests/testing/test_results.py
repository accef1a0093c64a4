"""Results, computed from events, and the exit code."""

from __future__ import annotations

import pytest

from rtf.testing.events import (
    Event,
    FixtureChanged,
    FixtureIncident,
    InternalError,
    Interrupted,
    Message,
    RunStarted,
    SuitePlanned,
    TestEnded,
    TestPlanned,
    TestRenamed,
    TestStarted,
)
from rtf.testing.results import RunResult
from rtf.testing.verdict import ExitCode, FixtureState, Phase, Severity, Verdict


def results_of(*verdicts: Verdict, more: tuple[Event, ...] = ()) -> RunResult:
    """Return the results of a run of one suite with these verdicts."""
    results = RunResult()
    events: list[Event] = [RunStarted(run="r", version="1"), SuitePlanned(suite="s", name="s")]
    for index, verdict in enumerate(verdicts):
        test = f"s/{index}"
        events += [TestPlanned(test=test, suite="s", name=str(index)), TestStarted(test=test)]
        events += [TestEnded(test=test, verdict=verdict, outcome=verdict)]
    for event in (*events, *more):
        results.apply(event)
    return results


CODES = {
    Verdict.PASSED: 0,
    Verdict.MEASURED: 0,
    Verdict.SKIPPED: 5,
    Verdict.EXPECTED_FAILURE: 0,
    Verdict.FLAKY: 0,
    Verdict.INCONCLUSIVE: 1,
    Verdict.UNEXPECTED_PASS: 1,
    Verdict.FAILED: 1,
    Verdict.ERROR: 1,
    Verdict.FIXTURE_LOST: 1,
    Verdict.BLOCKED: 1,
    Verdict.INTERRUPTED: 1,
    Verdict.NOT_RUN: 1,
}


@pytest.mark.parametrize("verdict", Verdict)
def test_exit_code_of_a_run_of_one_test(verdict: Verdict):
    """Good verdicts give 0, only skips give 5, all others 1."""
    assert results_of(verdict).exit_code() == CODES[verdict]


def test_one_bad_test_among_good_ones_is_a_failure():
    """One bad verdict makes the run fail."""
    assert results_of(*[Verdict.PASSED] * 9, Verdict.INCONCLUSIVE).exit_code() is ExitCode.FAILURES


def test_empty_run():
    """A run without tests has its own exit code, unless it is allowed."""
    assert results_of().exit_code() is ExitCode.NOTHING_RAN
    assert results_of().exit_code(allow_empty=True) is ExitCode.PASSED
    assert results_of().verdict() is Verdict.NOT_RUN


BROKE = InternalError(text="x")
STOPPED = Interrupted(source="x", stage=1)
GONE = FixtureChanged(fixture="rig", suite="s", generation=1, state=FixtureState.FAILED)
UNTIDY = FixtureIncident(fixture="rig", suite="s", generation=1, phase=Phase.TEARDOWN, cause="x")
GRUMBLE = Message(severity=Severity.ERROR, title="x", suite="s", fixture="rig")


@pytest.mark.parametrize(
    ("more", "code"),
    [
        ((BROKE, STOPPED, GONE, UNTIDY), 3),
        ((STOPPED, GONE, UNTIDY), 2),
        ((GONE, UNTIDY), 6),
        ((UNTIDY,), 1),
        ((GRUMBLE,), 1),
        ((), 0),
    ],
)
def test_what_comes_first_among_exit_codes(more: tuple[Event, ...], code: int):
    """The exit code is that of internal error, interrupt, fixture or failures, in this order."""
    assert results_of(Verdict.PASSED, more=more).exit_code() == code


def test_fixture_that_came_back_is_usable():
    """Only the last state of a fixture counts."""
    back = FixtureChanged(fixture="rig", suite="s", generation=2, state=FixtureState.READY)
    assert results_of(Verdict.PASSED, more=(GONE, back)).exit_code() is ExitCode.PASSED


def test_only_the_final_attempt_gives_the_verdict():
    """The last attempt gives verdict and messages; earlier ones are kept without messages."""
    test = "s/0"
    results = results_of(Verdict.PASSED)
    bad = Message(severity=Severity.FAILURE, title="x", test=test)
    again = TestEnded(test=test, verdict=Verdict.FAILED, outcome=Verdict.FAILED, attempt=1, final=False)
    last = TestEnded(test=test, verdict=Verdict.FLAKY, outcome=Verdict.PASSED, attempt=2)
    results.apply(TestStarted(test=test))
    results.apply(bad)
    results.apply(again)
    assert results.tests[test].verdict is None
    results.apply(TestStarted(test=test, attempt=2))
    assert results.tests[test].problems == []
    results.apply(last)
    assert results.tests[test].verdict is Verdict.FLAKY
    assert len(results.tests[test].attempts) == 3


def test_events_of_what_was_never_planned_are_passed_over():
    """Events of unplanned tests and suites are ignored."""
    results = results_of()
    for event in (
        TestStarted(test="x"),
        TestEnded(test="x", verdict=Verdict.PASSED, outcome=Verdict.PASSED),
        TestRenamed(test="x", name="y"),
        Message(severity=Severity.ERROR, title="x", test="x"),
        Message(severity=Severity.ERROR, title="x", suite="x"),
        FixtureChanged(fixture="x", suite="x", generation=1, state=FixtureState.FAILED),
        FixtureIncident(fixture="x", suite="x", generation=1, phase=Phase.RUN, cause="x"),
        TestPlanned(test="x/y", suite="x", name="y"),
    ):
        results.apply(event)
    assert results.exit_code(allow_empty=True) is ExitCode.FAILURES  # the one test that was planned never ended


def test_memory_of_a_test_that_fails_for_ever_is_bounded():
    """Fifty problems of a test are kept, and all are counted."""
    results = results_of(Verdict.FAILED)
    for _ in range(10_000):
        results.apply(Message(severity=Severity.FAILURE, title="x", test="s/0"))
        results.apply(Message(severity=Severity.ERROR, title="x", suite="s", fixture="rig"))
    test = results.tests["s/0"]
    assert (len(test.problems), test.problem_count) == (50, 10_000)
    assert len(results.suites["s"].problems) == 50


def test_a_case_belongs_to_its_program_and_no_test_to_itself():
    """A case belongs to its program; wrong parents in a journal are ignored."""
    results = RunResult()
    results.apply(SuitePlanned(suite="s", name="s"))
    for test, parent in (("s/p", ""), ("s/p::a", "s/p"), ("s/p::a::b", "s/p::a"), ("s/own", "s/own"), ("s/x", "s/no")):
        results.apply(TestPlanned(test=test, suite="s", name=test, parent=parent))
    assert [[case.id for case in test.cases] for test in results.tests.values()] == [["s/p::a"], [], [], [], []]
    assert not results.tests["s/own"].good
