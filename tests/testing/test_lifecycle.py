"""The life cycle of tests and suites: every row of ``docs/lifecycle.md``, in order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import pytest

from harness import Outcome, run_suite
from rtf.testing import attempts
from rtf.testing.events import (
    FixtureChanged,
    FixtureIncident,
    Measured,
    Message,
    PhaseStarted,
    SeriesSampled,
    SubResultEnded,
    SuiteEnded,
    TestEnded,
    TestPlanned,
    TestStarted,
)
from rtf.testing.suite.model import Timeouts
from rtf.testing.verdict import ExitCode, FixtureState, Phase, Severity, Verdict

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.testing.runner import Run

HEAD = """
import ctypes, os, time
from pathlib import Path
from rtf.testing import FixtureManager, TestCase
from rtf.testing.verdict import TestFailure, TestProblem

LOG = Path(__file__).with_name("log")

def note(word):
    with LOG.open("a") as stream:
        stream.write(word + "\\n")

def noted():
    return LOG.read_text().split() if LOG.exists() else []
"""


@dataclass(frozen=True)
class Row:
    """What a test does in each phase, with its results. ``done`` is the expected log, in order."""

    verdict: Verdict
    setup: str = ""
    run: str = ""
    teardown: str = ""
    done: str = "setup run teardown clean"
    messages: tuple[tuple[Severity, str, str], ...] = ()
    reason: str = ""


FAILURE, ERROR = Severity.FAILURE, Severity.ERROR
RAISED = "asserts failure with exception"
ROWS = {
    # The C++ framework's rules
    "setup returns false": Row(
        Verdict.ERROR, setup="return False", done="setup teardown clean", messages=((ERROR, "setup() failed!", ""),)
    ),
    "setup raises a failure": Row(
        Verdict.FAILED, setup="self.assert_fail('x')", done="setup teardown clean", messages=((FAILURE, RAISED, "x"),)
    ),
    "setup raises an error": Row(
        Verdict.ERROR,
        setup="self.assert_error('x')",
        done="setup teardown clean",
        messages=((ERROR, "asserts error with exception", "x"),),
    ),
    "setup raises anything": Row(
        Verdict.ERROR,
        setup="raise OSError('x')",
        done="setup teardown clean",
        messages=((ERROR, "exception", "OSError: x"),),
    ),
    "run raises a failure": Row(Verdict.FAILED, run="self.assert_fail('x')", messages=((FAILURE, RAISED, "x"),)),
    "run raises an error": Row(
        Verdict.ERROR, run="self.assert_error('x')", messages=((ERROR, "asserts error with exception", "x"),)
    ),
    "run raises anything": Row(Verdict.ERROR, run="raise OSError", messages=((ERROR, "exception", "OSError"),)),
    "run raises what is no Exception": Row(
        Verdict.ERROR, run="raise SystemExit(0)", messages=((ERROR, "exception", "the test raised SystemExit(0)"),)
    ),
    "a check does not hold": Row(
        Verdict.FAILED,
        run="self.check(False, 'x'); note('on')",
        done="setup run on teardown clean",
        messages=((FAILURE, "checks", "x"),),
    ),
    "teardown raises an error": Row(
        Verdict.ERROR, teardown="self.assert_error('x')", messages=((ERROR, "asserts error with exception", "x"),)
    ),
    "teardown raises a failure": Row(
        Verdict.FAILED, teardown="self.assert_fail('x')", messages=((FAILURE, RAISED, "x"),)
    ),
    "teardown raises anything": Row(
        Verdict.ERROR, teardown="raise OSError('x')", messages=((ERROR, "exception", "OSError: x"),)
    ),
    "it aborts": Row(Verdict.ERROR, run="os.abort()", done="setup run", reason="crash"),
    "it segfaults": Row(Verdict.ERROR, run="ctypes.string_at(0)", done="setup run", reason="crash"),
    # Rules of RTF alone
    "everything is fine": Row(Verdict.PASSED, run="self.check(True, 'x')"),
    "a plain assert": Row(Verdict.FAILED, run="assert 1 == 2, 'x'", messages=((FAILURE, RAISED, "x"),)),
    "it is skipped": Row(Verdict.SKIPPED, run="self.skip('x')"),
    "it is skipped in setup": Row(Verdict.SKIPPED, setup="self.skip('x')", done="setup teardown clean"),
    "it is inconclusive": Row(Verdict.INCONCLUSIVE, run="self.inconclusive('x')"),
    "it only measures": Row(Verdict.MEASURED, run="self.measure('x', 1.0, 'mm')"),
    "it measures within limits": Row(Verdict.PASSED, run="self.measure('x', 1.0, 'mm', high=2)"),
    "it measures outside limits": Row(
        Verdict.FAILED,
        run="self.measure('x', 3.0, 'mm', high=2); note('on')",
        done="setup run on teardown clean",
        messages=((FAILURE, "measures", "x = 3 mm, expected at most 2 mm, margin -1 mm"),),
    ),
    "a failure, then skipped": Row(
        Verdict.FAILED, run="self.check(False, 'x'); self.skip('y')", messages=((FAILURE, "checks", "x"),)
    ),
    "a failure, then inconclusive": Row(
        Verdict.FAILED, run="self.check(False, 'x'); self.inconclusive('y')", messages=((FAILURE, "checks", "x"),)
    ),
    "a failure, then an error": Row(
        Verdict.FAILED,
        run="self.check(False, 'x'); raise OSError('y')",
        messages=((FAILURE, "checks", "x"), (ERROR, "exception", "OSError: y")),
    ),
    "an error, then a failure": Row(
        Verdict.FAILED,
        run="raise OSError('x')",
        teardown="self.check(False, 'y')",
        messages=((ERROR, "exception", "OSError: x"), (FAILURE, "checks", "y")),
    ),
    "skipped, then teardown raises": Row(
        Verdict.ERROR,
        run="self.skip('x')",
        teardown="raise OSError('y')",
        messages=((ERROR, "exception", "OSError: y"),),
    ),
}


def plugin(row: Row) -> str:
    """Return the file of a test with the row's phases."""
    return (
        HEAD
        + f"""
class Life(TestCase):
    def setup(self):
        note("setup")
        self.add_cleanup(note, "clean")
        {row.setup or "pass"}

    def run(self):
        note("run")
        {row.run or "pass"}

    def teardown(self):
        note("teardown")
        {row.teardown or "pass"}
"""
    )


def log_of(tmp_path: Path) -> list[str]:
    """Return the notes of the plug-ins."""
    path = tmp_path / "suite" / "log"
    return path.read_text().split() if path.exists() else []


def verdicts(outcome: Outcome) -> list[Verdict | None]:
    """Return the verdicts of all tests in order."""
    return [test.verdict for test in outcome.results.tests.values()]


@pytest.mark.parametrize("name", ROWS)
def test_life_of_a_test(name: str, tmp_path: Path):
    """Teardown and clean-ups run whenever setup began; messages keep their kind; a failure is never hidden."""
    row = ROWS[name]
    outcome = run_suite(tmp_path, '<test name="t">t.py</test>', t__py=plugin(row))
    (ended,) = outcome.of(TestEnded)
    assert ended.verdict is row.verdict
    assert " ".join(log_of(tmp_path)) == row.done
    messages = [
        (message.severity, message.title, message.detail)
        for message in outcome.of(Message)
        if message.severity in (FAILURE, ERROR)
    ]
    if row.reason:
        assert ended.reason == row.reason
    else:
        assert messages == [*row.messages]
        assert ended.reason == {Verdict.FAILED: "failure", Verdict.ERROR: "error"}.get(row.verdict, "")
    assert outcome.exit_code == (
        0 if row.verdict.good and row.verdict is not Verdict.SKIPPED else 5 if row.verdict is Verdict.SKIPPED else 1
    )


def test_failure_says_in_which_phase_and_line_it_was_found(tmp_path: Path):
    """A failure in teardown has that phase, and the author's line."""
    outcome = run_suite(
        tmp_path, "<test>t.py</test>", t__py=plugin(Row(Verdict.FAILED, teardown="self.assert_fail('x')"))
    )
    (message,) = outcome.of(Message, severity=FAILURE)
    assert message.phase is Phase.TEARDOWN
    lines = (tmp_path / "suite" / "t.py").read_text().splitlines()
    assert "assert_fail" in lines[message.line - 1]


# Repetition, retries, expectations -----------------------------------------------------------------------------------


def test_repetition_runs_the_body_once_more_for_each(tmp_path: Path):
    """``repetition="4"`` runs five bodies between one setup and one teardown, also after a failure."""
    body = "self.check(noted().count('run') != 2, 'second')"
    outcome = run_suite(
        tmp_path, '<test name="t" repetition="4">t.py</test>', t__py=plugin(Row(Verdict.FAILED, run=body))
    )
    assert log_of(tmp_path) == ["setup", *["run"] * 5, "teardown", "clean"]
    assert outcome.verdict("t") is Verdict.FAILED
    parts = {event.subject: event.verdict for event in outcome.of(SubResultEnded)}
    assert parts == {f"repetition {count}/5": Verdict.FAILED if count == 2 else Verdict.PASSED for count in range(1, 6)}
    assert [event.repetition for event in outcome.of(PhaseStarted, phase=Phase.RUN)] == [1, 2, 3, 4, 5]


@pytest.mark.parametrize(
    ("safety", "runs"), [("Safety.MOTION", 2), ("'effort'", 2), ("Safety.STILL", 5), ("'still'", 5), ("''", 5)]
)
def test_repetition_of_what_moves_ends_with_the_first_that_is_bad(safety: str, runs: int, tmp_path: Path):
    """Repetitions of a test that moves end with the first failure; the rate counts those made."""
    body = "with self.subresult('part'): self.check(noted().count('run') != 2, 'second')"
    text = plugin(Row(Verdict.FAILED, run=body)).replace("def setup", f"safety = {safety}\n    def setup", 1)
    outcome = run_suite(
        tmp_path,
        '<test name="t" repetition="4">t.py</test>',
        t__py="from enum import IntEnum\nclass Safety(IntEnum):\n    STILL, MOTION = 0, 1\n" + text,
    )
    assert log_of(tmp_path) == ["setup", *["run"] * runs, "teardown", "clean"]
    assert outcome.verdict("t") is Verdict.FAILED
    warnings = [event.detail for event in outcome.of(Message, title="repetitions")]
    assert warnings[-1].startswith(f"{runs - 1} of {runs} passed")
    assert (len(warnings) == 2) is (runs < 5)


def test_repetition_says_pass_rate_with_confidence_and_durations(tmp_path: Path):
    """Pass rate and durations of repetitions are measurements, and a sentence."""
    body = "self.check(noted().count('run') != 2, 'second')"
    outcome = run_suite(tmp_path, '<test repetition="4">t.py</test>', t__py=plugin(Row(Verdict.FAILED, run=body)))
    numbers = {event.name: (event.value, event.unit) for event in outcome.of(Measured)}
    assert numbers["repetition pass rate"] == (80.0, "%")
    assert numbers["repetitions"] == (5.0, "count")
    low, middle, high = (numbers[f"repetition duration {name}"][0] for name in ("min", "median", "max"))
    assert 0 <= low <= middle <= high
    (sentence,) = outcome.of(Message, title="repetitions")
    assert sentence.detail.startswith("4 of 5 passed, 80% (95% confidence 37.6% to 96.4%); min ")


def test_retries_make_a_late_pass_flaky(tmp_path: Path):
    """A test that fails twice and then passes is flaky, with three reported attempts."""
    body = "self.assert_true(noted().count('run') == 3, 'not yet')"
    outcome = run_suite(tmp_path, '<test name="t" retries="5">t.py</test>', t__py=plugin(Row(Verdict.FLAKY, run=body)))
    ends = [(event.attempt, event.outcome, event.verdict, event.final) for event in outcome.of(TestEnded)]
    assert ends == [
        (1, Verdict.FAILED, Verdict.FAILED, False),
        (2, Verdict.FAILED, Verdict.FAILED, False),
        (3, Verdict.PASSED, Verdict.FLAKY, True),
    ]
    assert outcome.exit_code == ExitCode.PASSED


@pytest.mark.parametrize(
    ("later", "verdict"),
    [
        ("self.skip('x')", Verdict.FAILED),
        ("self.inconclusive('x')", Verdict.FAILED),
        ("raise OSError", Verdict.FAILED),
        ("os.abort()", Verdict.FAILED),
        ("self.measure('x', 1, 'mm')", Verdict.FLAKY),
    ],
)
def test_retries_hide_no_failure(later: str, verdict: Verdict, tmp_path: Path):
    """A test that failed stays failed unless a later attempt passes."""
    body = f"self.assert_true(noted().count('run') > 1, 'first'); {later}"
    outcome = run_suite(tmp_path, '<test name="t" retries="1">t.py</test>', t__py=plugin(Row(verdict, run=body)))
    assert outcome.verdict("t") is verdict
    assert len(outcome.of(TestEnded)) == 2


def test_no_retry_after_the_end_of_the_suites_time(tmp_path: Path):
    """A suite beyond its time limit starts no retry."""
    outcome = run_suite(
        tmp_path,
        '<suite name="s" timeout="1.5"><test name="t" retries="9">t.py</test></suite>',
        options={"grace": 0.2},
        t__py=plugin(Row(Verdict.ERROR, run="time.sleep(60)")),
    )
    (ended,) = outcome.of(TestEnded)
    assert (ended.verdict, ended.reason) == (Verdict.ERROR, "timeout")


@pytest.mark.parametrize(
    ("body", "verdict", "code"),
    [
        ("self.assert_fail('known')", Verdict.EXPECTED_FAILURE, 0),
        ("pass", Verdict.UNEXPECTED_PASS, 1),
        ("raise OSError", Verdict.ERROR, 1),
        ("self.skip('x')", Verdict.SKIPPED, 5),
    ],
)
def test_expected_failure(body: str, verdict: Verdict, code: int, tmp_path: Path):
    """An expected failure is good, a pass is unexpected, and an error is an error."""
    xml = '<test name="t" expected="fail" reason="bug 7" retries="3">t.py</test>'
    outcome = run_suite(tmp_path, xml, t__py=plugin(Row(verdict, run=body)))
    (ended,) = outcome.of(TestEnded)
    assert ended.verdict is verdict
    assert outcome.exit_code == code
    if verdict in (Verdict.EXPECTED_FAILURE, Verdict.UNEXPECTED_PASS):
        assert "bug 7" in ended.detail


def test_sub_results_do_not_hide_each_other(tmp_path: Path):
    """Each sub-result has its verdict, whatever ends the others."""
    body = """
        for part, what in enumerate(("pass", "fail", "error", "skip", "inconclusive")):
            with self.subresult(what):
                self.check(True, "made")
                if what == "fail": self.assert_fail("x")
                if what == "error": raise OSError
                if what == "skip": self.skip("x")
                if what == "inconclusive": self.inconclusive("x")
        note("end")
"""
    outcome = run_suite(tmp_path, '<test name="t">t.py</test>', t__py=plugin(Row(Verdict.FAILED, run=body.strip())))
    parts = {event.subject: event.verdict for event in outcome.of(SubResultEnded)}
    assert parts == {
        "pass": Verdict.PASSED,
        "fail": Verdict.FAILED,
        "error": Verdict.ERROR,
        "skip": Verdict.SKIPPED,
        "inconclusive": Verdict.INCONCLUSIVE,
    }
    assert outcome.verdict("t") is Verdict.FAILED
    assert "end" in log_of(tmp_path)


def test_test_that_needs_another_one_is_blocked_by_its_failure(tmp_path: Path):
    """A test is blocked if one that it requires did not pass, and so on."""
    xml = (
        '<test name="good">good.py</test><test name="bad">bad.py</test>'
        '<test name="after-good" requires="test:good">good.py</test>'
        '<test name="after-bad" requires="test:bad">good.py</test>'
        '<test name="after-blocked" requires="test:after-bad">good.py</test>'
    )
    outcome = run_suite(
        tmp_path,
        xml,
        good__py=plugin(Row(Verdict.PASSED)),
        bad__py=plugin(Row(Verdict.FAILED, run="self.assert_fail('x')")),
    )
    assert verdicts(outcome) == [Verdict.PASSED, Verdict.FAILED, Verdict.PASSED, Verdict.BLOCKED, Verdict.BLOCKED]
    assert outcome.detail("after-bad") == "needs test s/bad, which came to: failed"
    assert outcome.exit_code == ExitCode.FAILURES


def test_test_whose_surroundings_lack_something_is_skipped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A test without a required program, module, variable, file or feature is skipped, with its name."""
    monkeypatch.setenv("RTF_HAVE", "1")
    tokens = ("program:sh", "program:no-such", "module:json", "module:no_such", "env:RTF_HAVE", "env:RTF_LACK")
    tokens = (*tokens, "file:t.py", "file:none.txt", "granted", "refused")
    xml = "".join(f'<test name="n{index}" requires="{token}">t.py</test>' for index, token in enumerate(tokens))
    outcome = run_suite(tmp_path, xml, options={"features": frozenset({"granted"})}, t__py=plugin(Row(Verdict.PASSED)))
    assert verdicts(outcome) == [Verdict.PASSED, Verdict.SKIPPED] * 5
    assert "no-such" in outcome.detail("n1")
    assert "--feature refused" in outcome.detail("n9")


# Time-outs -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("phase", ["setup", "run", "teardown"])
def test_time_out_of_a_phase(phase: str, tmp_path: Path):
    """Each phase has its own limit, and the later phases run."""
    limits = {name: 1.0 if name == phase else 20 for name in ("setup", "run", "teardown")}
    row = Row(Verdict.ERROR, **{phase: "time.sleep(60)"})
    outcome = run_suite(
        tmp_path, '<test name="t">t.py</test>', options={"limits": Timeouts(**limits)}, t__py=plugin(row)
    )
    (ended,) = outcome.of(TestEnded)
    assert (ended.verdict, ended.reason) == (Verdict.ERROR, "timeout")
    assert ended.detail == f"{phase}() did not end within 1 s"
    assert log_of(tmp_path) == ["setup", *(["run"] if phase != "setup" else []), "teardown", "clean"]


def test_time_out_of_the_whole_test(tmp_path: Path):
    """``total-timeout`` limits an attempt over all phases."""
    xml = '<test name="t" total-timeout="1.5">t.py</test>'
    outcome = run_suite(tmp_path, xml, t__py=plugin(Row(Verdict.ERROR, run="time.sleep(60)")))
    assert outcome.detail("t") == "the test did not end within 1.5 s"
    assert log_of(tmp_path) == ["setup", "run", "teardown", "clean"]


def test_nearer_limits_win(tmp_path: Path):
    """The limit is that of the test, suite, author, command line, or default, in this order."""
    author = plugin(Row(Verdict.PASSED)).replace("def setup", "timeout = 33.0\n    def setup", 1)
    plain = plugin(Row(Verdict.PASSED))
    xml = '<test name="own" timeout="11">a.py</test><test name="suites">a.py</test>'
    options = {"limits": Timeouts(run=44.0)}
    first = run_suite(tmp_path, f"<timeout>22</timeout>{xml}", options=options, a__py=author)
    (tmp_path / "2").mkdir()
    xml = '<test name="authors">a.py</test><test name="lines">p.py</test>'
    second = run_suite(tmp_path / "2", xml, options=options, a__py=author, p__py=plain)
    (tmp_path / "3").mkdir()
    third = run_suite(tmp_path / "3", '<test name="default">p.py</test>', p__py=plain)
    limits = {event.name: event.run_timeout for outcome in (first, second, third) for event in outcome.of(TestPlanned)}
    assert limits == {"own": 11.0, "suites": 22.0, "authors": 33.0, "lines": 44.0, "default": 300.0}


def test_time_out_of_the_suite(tmp_path: Path):
    """The running test is stopped as an error, the rest is not run, and the fixture is torn down."""
    outcome = run_suite(
        tmp_path,
        '<suite name="s" timeout="3"><fixture>rig.py</fixture>'
        '<test name="a">t.py</test><test name="b">t.py</test></suite>',
        t__py=plugin(Row(Verdict.ERROR, run="time.sleep(60)")),
        rig__py=rig(),
    )
    assert verdicts(outcome) == [Verdict.ERROR, Verdict.NOT_RUN]
    assert outcome.detail("b") == "the suite did not end within 3 s"
    assert log_of(tmp_path) == ["up", "setup", "run", "teardown", "clean", "down"]
    assert outcome.exit_code == ExitCode.FAILURES


def test_time_out_of_the_run(tmp_path: Path):
    """The running test is stopped as by a second interrupt, the rest is not run, and the fixture is torn down."""
    outcome = run_suite(
        tmp_path,
        '<fixture>rig.py</fixture><test name="a">t.py</test><test name="b">t.py</test>',
        options={"run_timeout": 3.0},
        t__py=plugin(Row(Verdict.ERROR, run="time.sleep(60)")),
        rig__py=rig(),
    )
    assert verdicts(outcome) == [Verdict.INTERRUPTED, Verdict.NOT_RUN]
    assert log_of(tmp_path) == ["up", "setup", "run", "teardown", "clean", "down"]
    assert outcome.results.interrupted is not None
    assert outcome.results.interrupted.source == "time-out of the run after 3 s"
    assert outcome.results.interrupted.stage == 2
    assert outcome.exit_code == ExitCode.INTERRUPTED


@pytest.mark.parametrize("whose", ["suite", "run"])
def test_time_out_during_the_setup_of_a_fixture(whose: str, tmp_path: Path):
    """The limits of suite and run include the setup of fixtures."""
    timeout = ' timeout="5"' if whose == "suite" else ""
    outcome = run_suite(
        tmp_path,
        f'<suite name="s"{timeout}><fixture>rig.py</fixture><test name="a">t.py</test></suite>',
        options={"run_timeout": 5.0} if whose == "run" else {},
        t__py=plugin(Row(Verdict.PASSED)),
        rig__py=rig(setup="time.sleep(60)"),
    )
    assert verdicts(outcome) == [Verdict.NOT_RUN]
    assert log_of(tmp_path) == ["up", "down"]
    assert outcome.events[-1].duration < 20


def test_time_out_of_a_fixture(tmp_path: Path):
    """A fixture that is not ready in time fails after its restarts, and its tests are blocked."""
    outcome = run_suite(
        tmp_path,
        '<fixture timeout="0.4" restarts="1" backoff="0">rig.py</fixture><test name="a">t.py</test>',
        t__py=plugin(Row(Verdict.PASSED)),
        rig__py=rig(setup="time.sleep(60)"),
    )
    assert verdicts(outcome) == [Verdict.BLOCKED]
    assert "did not come back within 0.4 s" in outcome.detail("a")
    assert log_of(tmp_path) == ["up", "down", "up", "down"]
    assert outcome.exit_code == ExitCode.FIXTURE


# Suites and their fixtures -------------------------------------------------------------------------------------------


def rig(name: str = "", *, setup: str = "pass", check: str = "pass", teardown: str = "pass") -> str:
    """Return the file of a fixture that notes its calls."""
    return (
        HEAD
        + f"""
class Rig{name}(FixtureManager):
    def setup(self):
        note("up{name}")
        {setup}

    def check(self):
        {check}

    def teardown(self):
        note("down{name}")
        {teardown}
"""
    )


@pytest.mark.parametrize("how", ["return False", "raise OSError('x')"])
def test_fixture_that_does_not_come_up(how: str, tmp_path: Path):
    """A fixture that fails blocks its tests; all are torn down, and the exit code is 6."""
    outcome = run_suite(
        tmp_path,
        '<fixture name="a">a.py</fixture><fixture name="b" depends="a" restarts="0">b.py</fixture>'
        '<test name="x">t.py</test><test name="y">t.py</test><test name="z" fixtures="a">t.py</test>',
        a__py=rig("a"),
        b__py=rig("b", setup=how),
        t__py=plugin(Row(Verdict.PASSED)),
    )
    assert verdicts(outcome) == [Verdict.BLOCKED, Verdict.BLOCKED, Verdict.PASSED]
    assert log_of(tmp_path) == ["upa", "upb", "downb", "setup", "run", "teardown", "clean", "downa"]
    (incident,) = outcome.of(FixtureIncident)
    assert (incident.fixture, incident.phase) == ("b", Phase.SETUP)
    assert outcome.exit_code == ExitCode.FIXTURE


def test_fixture_that_was_never_needed_is_never_set_up(tmp_path: Path):
    """A fixture that no test needs is not set up."""
    outcome = run_suite(
        tmp_path,
        '<fixture name="a">a.py</fixture><fixture name="b">b.py</fixture><test name="x" fixtures="b">t.py</test>',
        a__py=rig("a"),
        b__py=rig("b"),
        t__py=plugin(Row(Verdict.PASSED)),
    )
    assert outcome.exit_code == ExitCode.PASSED
    assert log_of(tmp_path) == ["upb", "setup", "run", "teardown", "clean", "downb"]


@pytest.mark.parametrize(
    ("check", "cause"),
    [
        ("return not noted().count('run') == 1 or noted().count('up') > 1", "check() returned False"),
        ("assert not noted().count('run') == 1 or noted().count('up') > 1, 'x'", "x"),
        ("noted().count('run') == 1 and noted().count('up') == 1 and self.collapsed('said so')", "said so"),
    ],
)
def test_collapse_under_a_running_test(check: str, cause: str, tmp_path: Path):
    """The test is stopped without a failure, and runs again on the next generation; the incident is kept."""
    body = "time.sleep(60 if noted().count('run') == 1 else 0)"
    outcome = run_suite(
        tmp_path,
        '<fixture check-period="0.05" backoff="0">rig.py</fixture><test name="a">t.py</test><test name="b">t.py</test>',
        rig__py=rig(check=check),
        t__py=plugin(Row(Verdict.PASSED, run=body)),
    )
    ends = [(event.test, event.outcome, event.final) for event in outcome.of(TestEnded)]
    assert ends == [
        ("s/a", Verdict.FIXTURE_LOST, False),
        ("s/a", Verdict.PASSED, True),
        ("s/b", Verdict.PASSED, True),
    ]
    starts = [event.fixtures for event in outcome.of(TestStarted)]
    assert starts == [{"rig": 1}, {"rig": 2}, {"rig": 2}]
    (incident,) = outcome.of(FixtureIncident)
    assert cause in incident.cause
    assert incident.test == "s/a"
    assert outcome.exit_code == ExitCode.PASSED
    assert outcome.of(SuiteEnded)[0].verdict is Verdict.PASSED


def test_collapse_in_the_last_test_is_noticed(tmp_path: Path):
    """The fixture is checked before a verdict counts, also after the last test."""
    outcome = run_suite(
        tmp_path,
        '<fixture check-period="60" restarts="0">rig.py</fixture><test name="a">t.py</test>',
        rig__py=rig(check="return not noted().count('run')"),
        t__py=plugin(Row(Verdict.FIXTURE_LOST)),
    )
    assert outcome.results.tests["s/a"].attempts[0].outcome is Verdict.FIXTURE_LOST
    assert outcome.exit_code == ExitCode.FIXTURE


def test_test_that_fails_because_its_fixture_is_dying_is_not_blamed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A collapse shortly after a failure makes the attempt lost, not failed."""
    monkeypatch.setattr(attempts, "_SETTLING", 10.0)  # it ends with the collapse, however busy the machine is
    watch = """
        import threading
        def look():
            while "run" not in noted():
                time.sleep(0.001)
            self.collapsed("its program died")
        threading.Thread(target=look, daemon=True).start()"""
    outcome = run_suite(
        tmp_path,
        '<fixture check-period="60" restarts="0">rig.py</fixture><test name="a">t.py</test>',
        rig__py=rig(setup=watch.strip()),
        t__py=plugin(Row(Verdict.FIXTURE_LOST, run="self.assert_fail('no answer')")),
    )
    first = outcome.of(TestEnded)[0]
    assert (first.outcome, first.reason) == (Verdict.FIXTURE_LOST, "fixture")
    assert "its program died" in first.detail


@pytest.mark.parametrize(
    ("policy", "verdict", "runs", "code"),
    [("rerun", Verdict.PASSED, 2, 0), ("error", Verdict.FIXTURE_LOST, 1, 1), ("skip", Verdict.SKIPPED, 1, 5)],
)
def test_policy_for_a_test_that_lost_its_fixture(policy: str, verdict: Verdict, runs: int, code: int, tmp_path: Path):
    """``on-lost`` decides: run again once, leave as lost, or skip."""
    outcome = run_suite(
        tmp_path,
        f'<fixture check-period="60" backoff="0" on-lost="{policy}">rig.py</fixture><test name="a">t.py</test>',
        rig__py=rig(check="return not noted().count('run') or noted().count('up') > 1"),
        t__py=plugin(Row(verdict)),
    )
    assert outcome.verdict("a") is verdict
    assert log_of(tmp_path).count("run") == runs
    assert outcome.exit_code == code


def test_teardown_of_one_fixture_keeps_no_other_one_up(tmp_path: Path):
    """All fixtures are torn down in reverse order, also if one fails; the run fails, the tests do not."""
    outcome = run_suite(
        tmp_path,
        '<fixture name="a">a.py</fixture><fixture name="b">b.py</fixture><fixture name="c">c.py</fixture>'
        '<test name="x">t.py</test>',
        a__py=rig("a"),
        b__py=rig("b", teardown="raise OSError('x')"),
        c__py=rig("c", teardown="os.abort()"),
        t__py=plugin(Row(Verdict.PASSED)),
    )
    assert log_of(tmp_path)[-3:] == ["downc", "downb", "downa"]
    assert outcome.verdict("x") is Verdict.PASSED
    assert {incident.fixture for incident in outcome.of(FixtureIncident)} == {"b", "c"}
    assert outcome.exit_code == ExitCode.FAILURES
    last = {event.fixture: event.state for event in outcome.of(FixtureChanged)}
    assert set(last.values()) == {FixtureState.STOPPED}


def test_test_that_cannot_be_loaded_is_an_error_and_the_others_run(tmp_path: Path):
    """A test that cannot be loaded is an error with the searched places."""
    outcome = run_suite(
        tmp_path, '<test name="a">NoSuchPlugin</test><test name="b">t.py</test>', t__py=plugin(Row(Verdict.PASSED))
    )
    assert verdicts(outcome) == [Verdict.ERROR, Verdict.PASSED]
    (ended,) = outcome.of(TestEnded, test="s/a")
    assert (ended.reason, ended.attempt) == ("load", 0)
    assert str(tmp_path / "suite") in ended.detail
    assert outcome.exit_code == ExitCode.FAILURES


@pytest.mark.parametrize("stage", [1, 2])
def test_interrupt_from_outside(stage: int, tmp_path: Path):
    """Stage 1 lets the running test end, stage 2 stops it; the fixture is torn down, the rest is not run."""

    def interfere(run: Run) -> None:
        emit = run.emit

        def watch(event: object) -> None:
            emit(event)
            if isinstance(event, PhaseStarted) and event.phase is Phase.RUN:
                run.control.request("test", stage=stage)

        run.emit = watch

    outcome = run_suite(
        tmp_path,
        '<fixture>rig.py</fixture><test name="a">t.py</test><test name="b">t.py</test>',
        interfere=interfere,
        rig__py=rig(),
        t__py=plugin(Row(Verdict.PASSED, run="time.sleep(0.3 if STAGE == 1 else 60)".replace("STAGE", str(stage)))),
    )
    assert verdicts(outcome) == [Verdict.PASSED if stage == 1 else Verdict.INTERRUPTED, Verdict.NOT_RUN]
    assert log_of(tmp_path)[-1] == "down"
    assert outcome.exit_code == ExitCode.INTERRUPTED


def test_a_killed_test_leaves_what_was_watched_of_its_series(tmp_path: Path):
    """Of a series that never ended the journal has the sent samples."""
    code = """
import os
from rtf.testing import TestCase
class It(TestCase):
    def run(self):
        series = self.series("way", t="s", q="deg")
        series.append(0.0, 1.5)
        os.kill(os.getpid(), 9)
"""
    outcome = run_suite(tmp_path, '<test name="one">it.py</test>', it__py=code)
    (sampled,) = outcome.of(SeriesSampled, name="way")
    assert sampled.samples == ((0.0,), (1.5,))
    assert outcome.verdict("one") is Verdict.ERROR
