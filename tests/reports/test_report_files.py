"""Tests of what the reporters share: texts, targets, growing documents, and bounded memory."""

from __future__ import annotations

import gc
import math
import tracemalloc
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import pytest

from rtf.testing.broadcast import Broadcast
from rtf.testing.events import FixtureIncident, InternalError, Message, TestEnded, TestPlanned, TestStarted
from rtf.testing.report import text as report_text
from rtf.testing.report.files import FileReporter, Target, to_json
from rtf.testing.reporting import ReportOptions, load_reporter
from rtf.testing.results import RunResult
from rtf.testing.verdict import Phase, Severity, Verdict

if TYPE_CHECKING:
    from rtf.testing.report.files import AttemptEvents
    from rtf.testing.results import TestResult
    from tests.reports.conftest import Story


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0, "0 ms"),
        (0.0124, "12 ms"),
        (0.9996, "1.0 s"),
        (59.94, "59.9 s"),
        (59.96, "1 min 00 s"),
        (125, "2 min 05 s"),
        (3720, "1 h 02 min"),
        (math.nan, "? s"),
        (-1, "? s"),
    ],
)
def test_durations_are_written_for_people(seconds: float, text: str):
    """A duration is rounded before it is split, so that sixty seconds are a minute."""
    assert text == report_text.duration(seconds)


def test_counts_begin_with_what_needs_attention():
    """Counts begin with the verdicts that need attention, and leave out those that are zero."""
    numbers = {Verdict.PASSED: 4, Verdict.ERROR: 2, Verdict.FAILED: 1, Verdict.EXPECTED_FAILURE: 1, Verdict.SKIPPED: 0}
    assert report_text.counts(numbers) == "1 failed, 2 errors, 1 expected failure, 4 passed"
    assert report_text.counts({}) == "no tests"


def test_places_are_links(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A place is relative to the working folder if it is below it, with line and column if they are known."""
    monkeypatch.chdir(tmp_path)
    assert report_text.place(str(tmp_path / "a.py"), 3, 4) == "a.py:3:4"
    assert report_text.place("/else/where.py", 3) == "/else/where.py:3"
    assert report_text.place("a.py") == "a.py"
    assert report_text.place("", 3) == ""


def test_harmful_characters_are_written_out():
    """Control characters are escaped; harmless characters and other systems' line ends stay."""
    assert report_text.shown("é\t\x1b[31m\x9b\u202e\r\nx\ry") == "é\t\\x1b[31m\\x9b\\u202e\nx\\x0dy"
    assert report_text.shown("\ud83d\udc80 \ud83d") == "\U0001f480 \\ud83d"
    assert report_text.one_line("a\nb\n") == "a …"


def test_an_incident_is_one_sentence():
    """The sentence of an incident has fixture, generation, phase, cause, exit status and test."""
    event = FixtureIncident(
        fixture="sim", suite="s", generation=2, phase=Phase.CHECK, cause="died", exit_status=3, test="s/t"
    )
    assert report_text.incident(event) == "sim #2 in check: died (exit status 3), during s/t"


def test_json_is_strict():
    """JSON has neither NaN nor a lone surrogate, and a pair of surrogates is the character that it stands for."""
    record = {"a": [math.nan, math.inf, 1.5, True], "b": "\ud800\ud83d\udc80é"}
    assert to_json(record) == '{"a":["NaN","Infinity",1.5,true],"b":"\\\\ud800\U0001f480é"}'.encode()


class Words(FileReporter):
    """A document with the verdict of each test."""

    def entry(self, result: TestResult, attempts: list[AttemptEvents], results: RunResult) -> bytes:
        return f"{result.id} {result.verdict} {len(attempts)}\n".encode()

    def document(self, stream: BinaryIO, results: RunResult) -> None:
        stream.writelines(self.entries(results.tests))


def test_a_document_is_complete_at_any_time(story: Story, tmp_path: Path):
    """Each version of the document has the latest entry of every planned test; temporary parts leave no file."""
    report = tmp_path / "report"
    reporter, results = Words(ReportOptions(report, tmp_path)), RunResult()
    reporter.open()
    story.begin(("arm", 3)).start("arm").failing("arm/t2", final=False).failing("arm/t2").test("arm/t1")
    written = []
    for event in story.events:
        results.apply(event)
        reporter.handle(event, results)
        if isinstance(event, TestStarted | TestEnded):
            reporter.update(results)
            written.append(report.read_text())
    assert written[0] == "arm/t1 None 0\narm/t2 None 1\narm/t3 None 0\n"
    assert written[2] == "arm/t1 None 0\narm/t2 None 2\narm/t3 None 0\n"
    assert written[-1] == "arm/t1 passed 1\narm/t2 failed 2\narm/t3 None 0\n"
    reporter.close(results)
    assert [*tmp_path.iterdir()] == [report]


def test_a_target_that_failed_leaves_the_old_file(tmp_path: Path):
    """An error while a target is written leaves the old file and no partial one."""
    path = tmp_path / "report"
    path.write_bytes(b"old")
    with pytest.raises(TypeError), Target(path).writing() as stream:
        stream.write("half")  # type: ignore[arg-type]  # some mistake while it is being written
    assert path.read_bytes() == b"old"
    assert [*tmp_path.iterdir()] == [path]


@pytest.mark.parametrize("name", ["text", "json", "ctrf", "junit"])
def test_a_full_disk_is_reported_and_the_run_goes_on(name: str, story: Story, tmp_path: Path):
    """A full disk (/dev/full) is an internal error that names the reporter, and the run goes on."""
    reporter = load_reporter(name)(ReportOptions(Path("/dev/full"), tmp_path))
    reporter.open()
    broadcast = Broadcast(None, [reporter])
    for event in story.begin(("arm", 1)).start("arm").test("arm/t1").end("arm").finish().events:
        broadcast.emit(event)
    broadcast.close()
    (error,) = broadcast.results.internal_errors
    assert isinstance(error, InternalError)
    assert f"reporter {name} broke" in error.text
    assert "No space left" in error.text


@pytest.mark.parametrize("name", ["text", "json", "ctrf", "junit"])
def test_memory_does_not_grow_with_what_tests_say(name: str, story: Story, tmp_path: Path):
    """A test's messages leave the memory with the test; a few hundred bytes a test stay."""
    reporter = load_reporter(name)(ReportOptions(tmp_path / "report", tmp_path))
    reporter.open()
    broadcast = Broadcast(None, [reporter])
    for event in story.begin(("arm", 0)).events:
        broadcast.emit(event)
    tracemalloc.start()
    sizes = []
    for number in range(60):
        test = f"arm/{number}"
        broadcast.emit(TestPlanned(test=test, suite="arm", name=test))
        story.events.clear()
        story.test(test, Verdict.PASSED, *(said(test, count) for count in range(100)))
        for event in story.events:
            broadcast.emit(event)
        if number in (9, 59):
            broadcast.flush()  # events in the reporter's queue, and garbage in circles, do not stay
            gc.collect()
            sizes.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    broadcast.close()
    assert sizes[1] - sizes[0] < 50 * 3000


def said(test: str, count: int) -> Message:
    """Return a message of some length."""
    return Message(severity=Severity.PASS, title="checks", detail=f"{count} " + "x" * 200, test=test)
