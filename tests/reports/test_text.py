"""Tests of the C++ framework's result file and console: exact lines."""

from __future__ import annotations

import io
import sys
from typing import TYPE_CHECKING

import pytest

from rtf.testing.events import Measured, Message, OutputCaptured
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.verdict import FixtureState, Severity, Verdict

if TYPE_CHECKING:
    from tests.reports.conftest import Reports, Story

SUMMARY = """
---------- {} -----------
Total number of test suites  : 1
Number of passed test suites : 0
Number of failed test suites : 1
Total number of test cases   : 2
Number of passed test cases  : 1
Number of failed test cases  : 1
"""

LINES = """\
Test suite arm started...
Test case t1 started...
[INFO]  (t1) reports: moving
Test case t1 passed!
Test case t2 started...
[FAIL]  (t2) checks: too far
Test case t2 failed!
Test suite arm failed!
"""


@pytest.fixture
def simple(story: Story):
    """A story of one test that passes and one that fails."""
    story.begin(("arm", 2)).start("arm")
    said = Message(severity=Severity.INFO, title="reports", detail="moving", test="arm/t1", file="/lab/a.py", line=3)
    story.test("arm/t1", Verdict.PASSED, said).failing("arm/t2")
    return story.end("arm", Verdict.FAILED).finish()


def test_the_file_has_the_cpp_lines_and_summary(simple: Story, reports: Reports):
    """The file has the C++ framework's lines and summary, whatever the verbosity."""
    assert LINES + SUMMARY.format("summary") == reports("text", simple, verbosity=-1).read_text()


def test_detail_adds_the_place_and_an_empty_line(simple: Story, reports: Reports):
    """``--detail`` adds the place and an empty line, as in the C++ framework."""
    text = reports("text", simple, detail=True).read_text()
    assert "[INFO]  (t1) reports: moving\n/lab/a.py at 3.\n\nTest case t1 passed!\n" in text


def test_the_file_grows_while_the_run_goes_on(simple: Story, reports: Reports):
    """The file grows during the run; a file without the summary is seen to be incomplete."""
    path = reports("text", simple, close=False)
    assert path.read_text() == LINES
    reports.broadcast.close()


def test_what_the_cpp_framework_had_no_word_for_is_said_with_its_tags(story: Story, reports: Reports):
    """New kinds of events use the C++ tags, so that scripts which look for them and for ``passed!`` are not misled."""
    measured = Measured(test="arm/t1", name="reach", value=3.0, unit="deg", verdict=MeasurementVerdict.RECORDED)
    story.begin(("arm", 3)).start("arm").test("arm/t1", Verdict.MEASURED, measured)
    story.add(OutputCaptured(stream="stdout", text="\x1b[2Jnoise\n", fixture="sim", suite="arm"))
    story.incident("arm", "sim").fixture("arm", "sim", FixtureState.STARTING, 2)
    story.test("arm/t2", Verdict.BLOCKED, attempt=0, detail="no power").test("arm/t3", Verdict.UNEXPECTED_PASS)
    text = reports("text", story.end("arm", Verdict.FAILED).finish()).read_text()
    assert "[INFO]  (t1) measures: reach = 3 deg\n[INFO]  (t1) measured: \nTest case t1 passed!\n" in text
    assert "[INFO]  (sim) stdout: \\x1b[2Jnoise\n" in text
    assert "[ERROR] (arm) Fixture collapsed: sim #1 in check: the program died (SIGSEGV)\nlast\nwords\n" in text
    assert "[INFO]  (arm) reports: restarting fixture setup of sim (#2)\n" in text
    assert "[ERROR] (t2) blocked: no power\nTest case t2 failed!\n" in text
    assert "[FAIL]  (t3) unexpected pass: " in text


def test_the_console_shows_errors_and_failures_only(
    simple: Story, reports: Reports, capsys: pytest.CaptureFixture[str]
):
    """Without ``-v`` the console shows errors, failures and the summary, as the C++ framework's does."""
    reports("classic", simple, target=None)
    assert "[FAIL]  (t2) checks: too far\n" + SUMMARY.format("results") == capsys.readouterr().out


def test_the_console_shows_all_with_v(simple: Story, reports: Reports, capsys: pytest.CaptureFixture[str]):
    """With ``-v`` the console shows the file's lines, and lines about the runner."""
    reports("classic", simple, target=None, verbosity=1)
    expected = f"Starting test runner.\n{LINES}Ending test runner.\n{SUMMARY.format('results')}"
    assert expected == capsys.readouterr().out


def test_the_totals_can_be_left_out(simple: Story, reports: Reports, capsys: pytest.CaptureFixture[str]):
    """``--no-summary`` leaves the totals out, as in the C++ framework."""
    reports("classic", simple, target=None, extra={"summary": "no"})
    assert capsys.readouterr().out == "[FAIL]  (t2) checks: too far\n"


def test_colours_are_the_cpp_framework_where_they_are_wanted(
    simple: Story, reports: Reports, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    """FORCE_COLOR turns the C++ framework's colours on in a pipe; NO_COLOR turns them off."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    reports("classic", simple, target=None)
    assert capsys.readouterr().out.startswith("\x1b[91m[FAIL]  \x1b[0m(t2) checks")
    monkeypatch.setenv("NO_COLOR", "1")
    reports("classic", simple, target=None)
    assert "\x1b" not in capsys.readouterr().out


def test_a_terminal_of_few_letters_does_not_stop_the_run(
    story: Story, reports: Reports, monkeypatch: pytest.MonkeyPatch
):
    """Characters that the terminal's encoding lacks are escaped."""
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, encoding="ascii"))
    story.begin(("arm", 1)).start("arm").failing("arm/t1", "±3°").end("arm", Verdict.FAILED).finish()
    reports("classic", story, target=None)
    assert b"\\xb13\\xb0" in raw.getvalue()
