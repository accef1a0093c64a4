"""Tests of the HTML report: of runs that ended, were interrupted or killed, and of journals that cannot be read."""

from __future__ import annotations

import json
import signal
from typing import TYPE_CHECKING

import pytest

from archives import blocks
from harness import Command, run_command, write_files
from rtf.testing.broadcast import Broadcast
from rtf.testing.events import Interrupted, RunStarted, TestStarted, to_line
from rtf.testing.journal import FILE_NAME
from rtf.testing.reporting import ReportOptions, load_reporter
from tests.waiting import eventually

if TYPE_CHECKING:
    from pathlib import Path

PROBE = """
from rtf.testing import TestCase

class Probe(TestCase):
    def run(self):
        self.measure("supply", 23.9, "V", low=23.5, high=24.5)
        self.record("ramp", t=([0.0, 1.0], "s"), x=([1.0, 2.0], "deg"))
        self.attach(b"all is well", "note.txt")
"""
SLOW = """
from rtf.testing import TestCase
from rtf import clock

class Slow(TestCase):
    def run(self):
        clock.sleep(60)
"""


@pytest.fixture
def probe(tmp_path: Path) -> Path:
    """A folder with a test that measures, records and attaches, and one that takes long."""
    write_files(tmp_path, {"probe__py": PROBE, "slow__py": SLOW})
    return tmp_path


def test_the_report_command_writes_the_same_bytes_as_the_run(probe: Path):
    """``testrunner report`` writes the same bytes as the run, with its series and attachments."""
    ran = run_command(probe, "--test", "probe.py", "--report", "html=live.html")
    assert ran.exit_code == 0
    again = run_command(probe, "report", "rtf-runs/latest", "--report", "html=later.html")
    assert again.exit_code == 0
    live = (probe / "live.html").read_bytes()
    assert live == (probe / "later.html").read_bytes()
    found = blocks(live)
    assert found['id="rtf-journal"'] == (ran.folder / FILE_NAME).read_bytes()
    assert sum(name.startswith("data-series") for name in found) == 1
    assert b"all is well" in [data for name, data in found.items() if name.startswith("data-file")]


def test_it_is_written_when_the_run_is_interrupted(probe: Path):
    """A run that is interrupted twice still writes its page, with the whole journal."""
    command = Command(probe, "--test", "slow.py", "--grace", "0.3", "--report", "html=live.html")
    command.wait_for(lambda events: any(isinstance(event, TestStarted) for event in events))
    for stage in (1, 2):  # after the test; now
        command.signal(signal.SIGINT)
        command.wait_for(lambda events, stage=stage: sum(isinstance(event, Interrupted) for event in events) >= stage)
    ran = command.wait()
    assert ran.exit_code == 2
    assert blocks((probe / "live.html").read_bytes())['id="rtf-journal"'] == (ran.folder / FILE_NAME).read_bytes()


def test_a_run_that_was_killed_can_be_shown(probe: Path):
    """A killed run leaves a readable page; a page made later says that the runner was killed under the test."""
    command = Command(probe, "--test", "slow.py", "--grace", "0.3", "--report", "html=live.html")
    command.wait_for(lambda events: any(isinstance(event, TestStarted) for event in events))
    eventually((probe / "live.html").exists, "there is no page")
    command.signal(signal.SIGKILL)
    command.wait()
    assert b"test_planned" in blocks((probe / "live.html").read_bytes())['id="rtf-journal"']
    run_command(probe, "report", "rtf-runs/latest", "--report", "html=later.html")
    journal = blocks((probe / "later.html").read_bytes())['id="rtf-journal"']
    assert b"the runner was killed while this test was running" in journal
    assert not command.left_over()


def test_a_report_is_whole_or_not_there(tmp_path: Path):
    """An old page stays as it is when the new one cannot be made, and no partial file is left."""
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / FILE_NAME).write_bytes(to_line(RunStarted(run="r", version="1")) + b"nonsense\n" * 2)
    target = tmp_path / "report.html"
    target.write_text("old")
    reporter = load_reporter("html")(ReportOptions(target, folder))
    reporter.open()
    broadcast = Broadcast(None, [reporter])
    broadcast.close()
    assert [target.read_text(), *tmp_path.glob(".report*")] == ["old"]
    (error,) = broadcast.results.internal_errors
    assert f"{folder / FILE_NAME}:2" in error.text


def test_without_a_journal_it_is_refused_before_the_run(tmp_path: Path):
    """A reporter without a journal fails when it is opened, and names the journal."""
    reporter = load_reporter("html")(ReportOptions(tmp_path / "report.html", tmp_path))
    with pytest.raises(FileNotFoundError, match=FILE_NAME):
        reporter.open()


def test_without_a_target_it_goes_to_standard_output(probe: Path):
    """Without a target the page goes to standard output, and nothing else does."""
    run_command(probe, "--test", "probe.py")
    shown = run_command(probe, "report", "rtf-runs/latest", "--quiet", "--report", "html")
    assert shown.stdout.startswith("<!doctype html>")


def test_an_earlier_run_and_the_history_are_put_in(probe: Path):
    """The page has the run of ``--compare`` and the history, in which the run itself is included."""
    common = ("--test", "probe.py", "--history", "history.sqlite")
    run_command(probe, *common, "--run-folder", "first")
    run_command(probe, *common, "--run-folder", "second", "--compare", "first", "--html", "page.html")
    found = blocks((probe / "page.html").read_bytes())
    compared = json.loads(found['id="rtf-compare"'])
    assert (compared[0]["run"], compared[-1]["event"]) == ("first", "run_ended")
    assert [run["run"] for run in json.loads(found['id="rtf-history"'])["runs"]] == ["first", "second"]


def test_an_earlier_run_that_is_not_there_is_an_error_before_the_run(probe: Path):
    """A run of ``--compare`` that does not exist is a usage error, before any test runs."""
    ran = run_command(probe, "--test", "probe.py", "--compare", "gone", "--html", "page.html")
    assert ran.exit_code == 4
    assert "gone" in ran.stderr
    assert not (probe / "page.html").exists()


def test_a_history_that_cannot_be_read_is_named_in_the_page(tmp_path: Path):
    """A history that cannot be read is no internal error: the page is made without it and names its path."""
    (tmp_path / FILE_NAME).write_bytes(to_line(RunStarted(run="r", version="1")))
    (tmp_path / "history.sqlite").write_bytes(b"no database" * 100)
    target = tmp_path / "report.html"
    history = str(tmp_path / "history.sqlite")
    reporter = load_reporter("html")(ReportOptions(target, tmp_path, extra={"history": history}))
    reporter.open()
    broadcast = Broadcast(None, [reporter])
    broadcast.close()
    assert not broadcast.results.internal_errors
    facts = json.loads(blocks(target.read_bytes())['id="rtf-facts"'])
    assert (facts["history"], [row["path"] for row in facts["left_out"]]) == (False, [history])
