"""Tests of the console reporter: what each verbosity shows, and that no text can harm the terminal."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import struct
import subprocess
import sys
import termios
from contextlib import closing
from typing import TYPE_CHECKING, Any

import pytest

from rtf.testing.events import (
    Answered,
    Asked,
    Diagnosed,
    InternalError,
    Interrupted,
    Measured,
    Message,
    OutputCaptured,
    PhaseStarted,
    Progressed,
    StackDumped,
    SubResultEnded,
)
from rtf.testing.journal import FILE_NAME, Journal
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.verdict import FixtureState, Phase, Severity, Verdict

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tests.reports.conftest import Reports, Story


@pytest.fixture(autouse=True)
def plain(monkeypatch: pytest.MonkeyPatch):
    """Unset the variables that choose colours."""
    for name in ("NO_COLOR", "FORCE_COLOR", "CI"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def console(reports: Reports, capsys: pytest.CaptureFixture[str]):
    """Shows a story and returns the texts of standard output and standard error."""

    def show(story: Story, **options: Any) -> Any:
        reports("console", story, target=None, **options)
        return capsys.readouterr()

    return show


@pytest.fixture
def rich_story(story: Story, check_failed: Callable[..., Message]):
    """A story with events of every common kind."""
    story.begin(("arm", 4), fixtures=("sim",))
    story.add(
        Diagnosed(severity=Severity.WARNING, text="odd word", file="a.xml", line=3, column=4, hint="did you mean x?")
    )
    story.start("arm").fixture("arm", "sim", FixtureState.READY)
    said = [
        PhaseStarted(test="arm/t1", phase=Phase.RUN, limit=300.0),
        Message(severity=Severity.INFO, title="reports", detail="moving", test="arm/t1", file="/lab/a.py", line=3),
        Measured(test="arm/t1", name="reach", value=3.0, unit="deg", verdict=MeasurementVerdict.RECORDED),
        SubResultEnded(test="arm/t1", subject="joint 3", verdict=Verdict.PASSED),
        Progressed(test="arm/t1", fraction=0.5, text="half way"),
        OutputCaptured(stream="stdout", text="noise\n", test="arm/t1"),
        StackDumped(text="Thread 1", cause="hung", test="arm/t1"),
    ]
    story.test("arm/t1", Verdict.PASSED, *said, duration=1.5)
    story.test("arm/t2", Verdict.FAILED, check_failed("arm/t2"), final=False, detail="too far")
    story.test("arm/t2", Verdict.FLAKY, outcome=Verdict.PASSED, attempt=2)
    story.incident("arm", "sim", exit_status=139, test="arm/t3").fixture("arm", "sim", FixtureState.STARTING, 2)
    story.fixture("arm", "sim", FixtureState.READY, 2).failing("arm/t3", "too far\nreally")
    story.test("arm/t4", Verdict.BLOCKED, attempt=0, detail="no power")
    return story.end("arm", Verdict.FAILED).finish()


def test_a_line_a_test_and_the_verdict_last(console: Callable[..., Any], rich_story: Story, reports: Reports):
    """By default the console shows one line a test, the failures, and the verdict last."""
    expected = f"""\
Suite arm
  passed        t1  1.5 s
  failed        t2  250 ms  (attempt 1, once more)
      too far  (/lab/reach.py:12)
  flaky         t2  250 ms
fixture sim #1 in check: the program died (exit status 139, SIGSEGV), during arm/t3
    | last
    | words
fixture sim #2 is being restarted
fixture sim #2 is back
  failed        t3  250 ms
      too far …  (/lab/reach.py:12)
  blocked       t4
      no power

Failures
  failed  arm/t3
      checks: too far
      really
        at /lab/reach.py:12
      Traceback (most recent call last)
  blocked  arm/t4
      no power
        at /lab/suites/arm.xml:4

Fixture incidents
  sim #1 in check: the program died (exit status 139, SIGSEGV), during arm/t3

Slowest tests
       1.5 s  arm/t1

Reports
  junit.xml
  {reports.folder}

FAILED  1 failed, 1 blocked, 1 flaky, 1 passed in 12.5 s
"""
    shown = console(rich_story, extra={"reports": "junit.xml"})
    assert expected == shown.out
    assert shown.err == "a.xml:3:4: warning: odd word\n  did you mean x?\n"


def test_the_end_can_be_the_verdict_alone(console: Callable[..., Any], rich_story: Story):
    """With ``--no-summary`` the console ends with the verdict's line alone."""
    out = console(rich_story, extra={"summary": "no"}).out
    assert "Failures" not in out
    assert out.endswith("no power\n\nFAILED  1 failed, 1 blocked, 1 flaky, 1 passed in 12.5 s\n")


def test_quiet_shows_what_did_not_pass_and_one_line(console: Callable[..., Any], rich_story: Story):
    """``-q`` shows the tests that did not pass, the incidents, and the verdict."""
    expected = """\
fixture sim #1 in check: the program died (exit status 139, SIGSEGV), during arm/t3
  failed        arm/t3  250 ms
      too far …  (/lab/reach.py:12)
  blocked       arm/t4
      no power
FAILED  1 failed, 1 blocked, 1 flaky, 1 passed in 12.5 s
"""
    assert expected == console(rich_story, verbosity=-1).out


def test_a_quiet_run_that_passes_is_one_line(console: Callable[..., Any], story: Story):
    """A run that passes with ``-q`` prints one line."""
    story.begin(("arm", 1)).start("arm").test("arm/t1").end("arm").finish()
    assert console(story, verbosity=-1).out == "PASSED  1 passed in 12.5 s\n"


def test_verbosity_adds_messages_and_then_output(console: Callable[..., Any], rich_story: Story):
    """``-v`` adds messages and measurements; ``-vv`` adds output, phases and progress."""
    usual = console(rich_story).out
    verbose = console(rich_story, verbosity=1).out
    most = console(rich_story, verbosity=2).out
    for text in (
        "reports: moving  (/lab/a.py:3)",
        "measure  reach = 3 deg",
        "part     joint 3 passed",
        "running       t1",
    ):
        assert text not in usual
        assert text in verbose
    for text in ("stdout | noise", "phase    run (at most 5 min 00 s)", "50 %  half way"):
        assert text not in verbose
        assert text in most


def test_what_is_no_test_goes_to_standard_error(console: Callable[..., Any], story: Story):
    """Interrupts and internal errors go to standard error."""
    story.begin(("arm", 0)).add(Interrupted(source="SIGINT", stage=1), InternalError(text="broke", traceback="trace"))
    assert (
        console(story).err == "interrupted by SIGINT: the running test goes on to its end, then the run stops; "
        "once more stops the test now\ninternal error: broke\ntrace\n"
    )


@pytest.mark.parametrize(
    ("stage", "said"),
    [(2, "stopping the running test; once more kills it"), (3, "killing what still runs")],
)
def test_an_interrupt_says_what_once_more_would_do(console: Callable[..., Any], story: Story, stage: int, said: str):
    """The line of an interrupt says what the next Ctrl-C does."""
    story.begin(("arm", 0)).add(Interrupted(source="SIGINT", stage=stage))
    assert console(story).err == f"interrupted by SIGINT: {said}\n"


@pytest.fixture
def blocked_story(story: Story) -> Story:
    """A story of a fixture that never comes up, and of the tests that it blocks."""
    story.begin(("arm", 5), fixtures=("names",)).start("arm")
    for generation in (1, 2, 3):
        story.incident("arm", "names", "no answer", generation=generation, phase=Phase.SETUP, signal="", output="")
    story.fixture("arm", "names", FixtureState.FAILED, 3, detail="no answer (2 restarts used up)")
    for number in range(1, 6):
        detail = "fixture names is not usable: no answer (2 restarts used up)"
        story.test(f"arm/t{number}", Verdict.BLOCKED, attempt=0, detail=detail, reason="fixture")
    return story.end("arm", Verdict.BLOCKED).finish()


def test_what_many_tests_have_in_common_is_said_once(
    console: Callable[..., Any], blocked_story: Story, reports: Reports
):
    """A reason that many tests share is written once, so that a hundred blocked tests fit on one screen."""
    expected = f"""\
fixture names #1 in setup: no answer
fixture names #2 in setup: the same again
fixture names #3 in setup: the same again
fixture names #3 is given up (2 restarts used up)
Suite arm
  blocked       t1
      fixture names is not usable: no answer (2 restarts used up)
  blocked       t2
  blocked       t3
  blocked       t4
  blocked       t5

Failures
  blocked  5 tests: arm/t1 … arm/t5
      fixture names is not usable: no answer (2 restarts used up)

Fixture incidents
  names #1 in setup: no answer  (and 2 more like it, up to #3)

Reports
  {reports.folder}

BLOCKED  5 blocked in 12.5 s
"""
    assert expected == console(blocked_story).out


def test_few_tests_are_named_and_the_same_is_not_said_twice(
    console: Callable[..., Any], story: Story, check_failed: Callable[..., Message]
):
    """Every failed test is named; a text that several tests share is written once, under the last of them."""
    story.begin(("arm", 5)).start("arm")
    for number in range(1, 5):
        test = f"arm/t{number}"
        story.test(test, Verdict.FAILED, check_failed(test), check_failed(test), detail="too far")
    story.test("arm/t5", Verdict.FAILED, check_failed("arm/t5", "too slow"), detail="too slow")
    out = console(story.end("arm", Verdict.FAILED).finish()).out
    failures = out.partition("\nFailures\n")[2].partition("\n\n")[0]
    assert failures.startswith("  failed  arm/t1\n  failed  arm/t2\n  failed  arm/t3\n  failed  arm/t4\n      checks:")
    assert failures.count("checks: too far") == 1
    assert failures.count("checks: too slow") == 1


@pytest.mark.parametrize("verbosity", [0, 1])
def test_tracebacks_of_rtf_itself_need_verbosity(console: Callable[..., Any], story: Story, verbosity: int):
    """Tracebacks of lost fixtures and wrong parameters are shown with ``-v`` only; those of a test's code, always."""
    story.begin(("arm", 3)).start("arm")
    for number, (verdict, detail, line) in enumerate(
        [
            (Verdict.FIXTURE_LOST, "ConnectError: gone", "in rtf.py"),
            (Verdict.ERROR, "ParameterError: 1 problem:\n  speed: fast is no number", "in parameters.py"),
            (Verdict.ERROR, "ValueError: boom", "in reach.py"),
        ],
        start=1,
    ):
        test = f"arm/t{number}"
        trace = f"Traceback (most recent call last)\n  {line}\n"
        said = Message(severity=Severity.ERROR, title="exception", detail=detail, test=test, traceback=trace)
        ending = "sim: it died" if verdict is Verdict.FIXTURE_LOST else detail
        story.test(test, verdict, said, detail=ending, reason="error")
    out = console(story.end("arm", Verdict.FAILED).finish(), verbosity=verbosity).out
    failures = out.partition("\nFailures\n")[2]
    for sentence in ("sim: it died", "ConnectError: gone", "speed: fast is no number", "ValueError: boom"):
        assert sentence in failures
    assert "in reach.py" in failures
    assert ("in rtf.py" in failures, "in parameters.py" in failures) == (verbosity > 0, verbosity > 0)


def test_failures_of_suites_and_fixtures_are_always_shown(console: Callable[..., Any], story: Story):
    """An error that belongs to a fixture and to no test is shown among the failures."""
    story.begin(("arm", 1)).start("arm").test("arm/t1")
    story.add(Message(severity=Severity.ERROR, title="teardown", detail="no answer", suite="arm", fixture="sim"))
    out = console(story.end("arm", Verdict.FAILED).finish()).out
    assert "error    fixture sim: teardown: no answer" in out
    assert "Failures" in out


def test_questions_and_answers_are_shown(console: Callable[..., Any], story: Story):
    """The console shows each question with its choices, and the answer with its source."""
    story.begin(("arm", 1)).start("arm")
    asked = Asked(test="arm/t1", question="q", text="Is it up?", choices=("yes", "no"))
    story.test("arm/t1", Verdict.PASSED, asked, Answered(test="arm/t1", question="q", source="timeout"))
    out = console(story.end("arm").finish()).out
    assert "question     Is it up? [yes / no]  (1 min 00 s)\n  answer       no answer (timeout)\n" in out


@pytest.mark.parametrize("verbosity", [-1, 0, 1, 2])
def test_nothing_a_test_says_reaches_the_terminal_raw(
    console: Callable[..., Any], story: Story, check_failed: Callable[..., Message], verbosity: int
):
    """The console writes escape sequences, carriage returns, bidirectional marks and rich's markup as plain text."""
    evil = "\x1b[2J\x9b31m\r\x07\u202e[bold]x[/bold]\x00\ud800"
    story.begin(("arm", 2), fixtures=(evil,)).start("arm").fixture("arm", evil, FixtureState.STARTING, 2)
    said = [
        check_failed("arm/t1", evil, subject=evil, file=evil),
        OutputCaptured(stream=evil, text=evil, test="arm/t1"),
    ]
    story.test("arm/t1", Verdict.FAILED, *said, detail=evil).incident("arm", evil, evil, output=evil, traceback=evil)
    story.add(Diagnosed(severity=Severity.ERROR, text=evil, file=evil, hint=evil, suite=evil))
    shown = console(story.test("arm/t2", Verdict.BLOCKED, attempt=0, detail=evil).finish(), verbosity=verbosity)
    assert not re.search("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202e\ud800-\udfff]", shown.out + shown.err)
    assert "\\x1b[2J" in shown.out
    assert "[bold]x[/bold]" in shown.out


def test_colours_only_when_they_are_wanted(
    console: Callable[..., Any], rich_story: Story, monkeypatch: pytest.MonkeyPatch
):
    """A pipe has no colours; FORCE_COLOR turns them on, NO_COLOR off, and the caller's choice counts more than both."""
    assert "\x1b" not in console(rich_story).out
    monkeypatch.setenv("FORCE_COLOR", "1")
    assert "\x1b[32mpassed" in console(rich_story).out
    monkeypatch.setenv("NO_COLOR", "1")
    assert "\x1b" not in console(rich_story).out
    assert "\x1b" in console(rich_story, colour=True).out


SHOW = """
import sys
from pathlib import Path
from rtf.testing import journal
from rtf.testing.reporting import ReportOptions, load_reporter
from rtf.testing.broadcast import Broadcast

reporter = load_reporter("console")(ReportOptions(None, Path("run")))
reporter.open()
broadcast = Broadcast(None, [reporter])
for event in journal.read(Path(sys.argv[1])):
    broadcast.emit(event)
    broadcast.flush()
    if reporter._region is not None:
        reporter._region.refresh()
broadcast.close()
sys.stdout.flush()
print("rich" in sys.modules, [str(error) for error in broadcast.results.internal_errors], file=sys.stderr)
"""


@pytest.fixture
def journal_path(rich_story: Story, tmp_path: Path) -> Path:
    """The story as a journal on disk."""
    path = tmp_path / FILE_NAME
    with closing(Journal(path)) as journal:
        for event in rich_story.events:
            journal.append(event)
    return path


def on_a_terminal(command: list[str], **environment: str) -> tuple[str, str]:
    """Return what a command writes to a terminal of 100 columns, and to standard error."""
    leader, follower = pty.openpty()
    fcntl.ioctl(follower, termios.TIOCSWINSZ, struct.pack("HHHH", 30, 100, 0, 0))
    program = subprocess.Popen(
        command, stdin=follower, stdout=follower, stderr=subprocess.PIPE, env=os.environ | environment
    )
    os.close(follower)
    written = b""
    while True:
        try:
            data = os.read(leader, 65536)
        except OSError:  # Linux says so when the last one has closed the terminal
            break
        if not data:
            break
        written += data
    os.close(leader)
    return written.decode(), program.communicate(timeout=30)[1].decode()


def test_a_terminal_gets_a_region_that_goes_away(journal_path: Path):
    """A terminal has a live region that disappears: the lines stay, the cursor comes back, the verdict is last."""
    out, err = on_a_terminal([sys.executable, "-c", SHOW, str(journal_path)], TERM="xterm-256color")
    assert err.endswith("True []\n")
    assert "sim #1 ready" in out
    assert out.count("\x1b[?25l") == out.count("\x1b[?25h") == 1
    plain_text = re.sub("\x1b\\[[0-9;?]*[A-Za-z]", "", out).replace("\r", "")
    assert "  passed        t1  1.5 s\n" in plain_text
    assert plain_text.endswith("FAILED  1 failed, 1 blocked, 1 flaky, 1 passed in 12.5 s\n")


@pytest.mark.parametrize("environment", [{"TERM": "dumb"}, {"TERM": "xterm", "CI": "true", "NO_COLOR": "1"}])
def test_nothing_moves_where_it_would_disturb(journal_path: Path, environment: dict[str, str]):
    """A dumb terminal and a CI log get plain lines, and rich is not even imported."""
    out, err = on_a_terminal([sys.executable, "-c", SHOW, str(journal_path)], **environment)
    assert err.endswith("False []\n")
    assert "\x1b" not in out


def test_a_reader_that_has_seen_enough_breaks_nothing(journal_path: Path):
    """A closed pipe, as in ``testrunner … | head -1``, does not break the run."""
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-c", SHOW.replace("sys.stdout.flush()", ""), str(journal_path)]
    program = subprocess.Popen(command, stdout=writing, stderr=subprocess.PIPE)
    os.close(writing)
    assert b"False []" in program.communicate(timeout=30)[1]
