"""Tests of the history reporter: it adds a run at its end, and a broken file changes no verdict."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import psutil
import pytest

from harness import Command, run_command, write_files
from rtf.testing.events import Measured, TestStarted
from rtf.testing.history import History
from rtf.testing.journal import FILE_NAME
from rtf.testing.reporting import ReportOptions, load_reporter
from rtf.testing.results import RunResult
from rtf.testing.verdict import ExitCode, Verdict

if TYPE_CHECKING:
    from rtf.testing.history import StoredRun

PROBE = """
import os
from rtf.testing import TestCase
class Probe(TestCase):
    def run(self):
        with self.subresult("knee"):
            self.measure("error", float(os.environ.get("ERROR", "0.5")), "deg", low=0.0, high=1.0)
"""
HANG = """
import os, signal
from rtf.testing import TestCase
class Hang(TestCase):
    def run(self):
        self.measure("before", 1.0)
        if os.environ.get("HANG"):
            signal.pause()
"""
SUITE = '<suite name="s"><test>probe.py</test><test>hang.py</test></suite>'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a suite of two tests."""
    write_files(tmp_path, {"probe__py": PROBE, "hang__py": HANG, "s__xml": SUITE})
    return tmp_path


def kept(path: Path) -> list[tuple[StoredRun, dict[str, str], dict[str, float | None]]]:
    """Return the runs of a history, oldest first, each with its verdicts and measurements."""
    with History(path) as history:
        return [
            (
                run,
                {row[0]: row[3] for row in history.tests(number)},
                {f"{row[1]}:{row[2]}": row[4] for row in history.measurements(number)},
            )
            for number, run in reversed(history.runs())
        ]


RUN = ("--suite", "s.xml", "-q", "--robot", "icub01", "--station", "bench", "--report", "history=h.sqlite")


def test_runs_of_a_station_come_together_in_one_file(folder: Path):
    """The history has each run with its verdicts, measurements, robot and station, whether the run passed or failed."""
    assert run_command(folder, *RUN, ERROR="1.5").exit_code == ExitCode.FAILURES
    assert run_command(folder, *RUN).exit_code == ExitCode.PASSED
    first, second = kept(folder / "h.sqlite")
    assert first[1:] == ({"s/probe": "failed", "s/hang": "measured"}, {"knee:error": 1.5, ":before": 1.0})
    assert second[1:] == ({"s/probe": "passed", "s/hang": "measured"}, {"knee:error": 0.5, ":before": 1.0})
    assert [(run.verdict, run.exit_code, run.robot, run.station) for run, *_ in (first, second)] == [
        ("failed", 1, "icub01", "bench"),
        ("passed", 0, "icub01", "bench"),
    ]
    assert (folder / "rtf-runs" / "latest").resolve() == Path(second[0].folder)


def test_without_a_file_it_is_the_users_own(folder: Path):
    """Without a file's name, the history is in the user's data folder."""
    done = run_command(folder, *RUN[:-1], "history", XDG_DATA_HOME=str(folder / "data"))
    assert done.exit_code == 0
    assert len(kept(folder / "data" / "rtf" / "history.sqlite")) == 1


def test_a_report_made_later_says_the_same(folder: Path):
    """``testrunner report`` adds from the journal exactly what the run added, and adds a run only once."""
    run_command(folder, *RUN)
    before = kept(folder / "h.sqlite")
    for target in ("h.sqlite", "new.sqlite"):
        assert run_command(folder, "report", "rtf-runs/latest", "-q", "--report", f"history={target}").exit_code == 0
        assert kept(folder / target) == before


def test_a_killed_run_is_not_in_it_until_it_is_resumed_or_taken_in(folder: Path):
    """A killed run is not in the history; ``--import`` adds it as interrupted, and refuses a run that goes on."""
    running = Command(folder, *RUN, HANG="1")
    running.wait_for(lambda events: any(isinstance(e, Measured) and e.name == "before" for e in events))
    imported = run_command(folder, "history", "--import", "rtf-runs/latest", "--history", "h.sqlite")
    assert imported.exit_code == ExitCode.USAGE
    assert "this run is still going on" in imported.stderr
    running.signal(signal.SIGKILL)
    running.wait()
    assert running.left_over() == []
    assert kept(folder / "h.sqlite") == []
    assert run_command(folder, "history", "--import", "rtf-runs/latest", "--history", "h.sqlite").exit_code == 0
    ((run, tests, measured),) = kept(folder / "h.sqlite")
    assert (run.verdict, tests["s/hang"], measured[":before"]) == ("interrupted", "interrupted", 1.0)
    assert run_command(folder, "--resume", "rtf-runs/latest", "-q").exit_code == 0
    ((resumed, tests, _),) = kept(folder / "h.sqlite")
    assert (resumed.started, resumed.verdict, tests["s/hang"]) == (run.started, "passed", "measured")


# A file that cannot be used ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("/proc/nowhere/h.sqlite", "name a file that can be written with --history FILE"),
        ("s.xml/h.sqlite", "name a file that can be written with --history FILE"),
        ("s.xml", "file is not a database; move it away"),
        (".", "name a file that can be written with --history FILE"),
    ],
)
def test_a_history_that_cannot_be_opened_is_an_error_before_the_run(folder: Path, target: str, message: str):
    """A history that cannot be opened is a usage error with a hint, before any test runs."""
    done = run_command(folder, *RUN[:-1], f"history={target}")
    assert done.exit_code == ExitCode.USAGE
    assert done.stderr.startswith("testrunner: report history cannot be written: cannot use the history")
    assert message in done.stderr
    assert not done.of(TestStarted)


def test_a_history_that_may_not_be_written_is_an_error_before_the_run_and_can_be_read(folder: Path):
    """A read-only history is a usage error for a run, and can still be read."""
    run_command(folder, *RUN)
    archive = folder / "archive"
    archive.mkdir()
    shutil.copy(folder / "h.sqlite", archive)
    (archive / "h.sqlite").chmod(0o444)
    archive.chmod(0o555)
    try:
        for file in ("h.sqlite", "new.sqlite"):
            done = without_privilege(folder, *RUN[:-1], f"history=archive/{file}")
            assert (done.returncode, "history cannot be written" in done.stderr) == (ExitCode.USAGE, True)
        done = without_privilege(folder, "history", "--history", "archive/h.sqlite")
        assert (done.returncode, done.stderr) == (0, "")
        assert [path.name for path in archive.iterdir()] == ["h.sqlite"]
    finally:
        archive.chmod(0o755)


def without_privilege(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run ``testrunner`` under the permissions of files, which do not stop the superuser."""
    if os.geteuid() == 0 and shutil.which("setpriv") is None:
        pytest.skip("the superuser cannot be stopped without setpriv")
    stopped = ["setpriv", "--bounding-set=-dac_override"] if os.geteuid() == 0 else []
    command = [*stopped, sys.executable, "-m", "rtf.cli.testrunner", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=60)


SPOILER = """
import shutil
from pathlib import Path
from rtf.testing import TestCase
class Spoiler(TestCase):
    def run(self):
        shutil.rmtree("data")
        Path("data").write_text("in the way")
        self.measure("error", 2.5)
"""


def test_a_history_lost_during_the_run_changes_no_verdict(folder: Path):
    """A history that cannot be written at the end changes no verdict; the printed command adds the run later."""
    write_files(folder, {"spoiler__py": SPOILER})
    done = run_command(folder, "--test", "spoiler.py", "--report", "history=data/h.sqlite")
    assert done.exit_code == ExitCode.PASSED
    assert done.stdout.splitlines()[-1].startswith("PASSED")
    first, second = done.stderr.splitlines()
    assert first.startswith("history: this run is not in it: cannot use the history data/h.sqlite: ")
    command = second.partition("to put it in: testrunner ")[2].split()
    (folder / "data").unlink()
    assert run_command(folder, *command).exit_code == 0
    assert kept(folder / "data" / "h.sqlite")[0][2] == {":error": 2.5}


def test_a_journal_that_cannot_be_read_changes_no_verdict(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A broken journal is reported at the end, and nothing of its run is added."""
    (tmp_path / FILE_NAME).write_text('{"event":"run_started","run":"r","version":"1"}\nnothing\nnothing\n')
    reporter = load_reporter("history")(ReportOptions(tmp_path / "h.sqlite", tmp_path))
    reporter.open()
    printed: list[str] = []
    monkeypatch.setattr("atexit.register", lambda _print, text, **_: printed.append(text))
    reporter.close(RunResult())
    assert f"this run is not in it: {tmp_path / FILE_NAME}:2: not JSON" in printed[0]
    assert kept(tmp_path / "h.sqlite") == []


def test_without_a_journal_there_is_nothing_to_take_from(tmp_path: Path):
    """A run folder without a journal is an error, and the history's file is not created."""
    with pytest.raises(FileNotFoundError, match=FILE_NAME):
        load_reporter("history")(ReportOptions(tmp_path / "h.sqlite", tmp_path)).open()
    assert not [*tmp_path.iterdir()]


def test_the_reporter_leaves_nothing_open_during_the_run(tmp_path: Path):
    """The reporter keeps no file open during the run, so that the history can be moved or copied."""
    path = tmp_path / "h.sqlite"
    (tmp_path / FILE_NAME).touch()
    reporter = load_reporter("history")(ReportOptions(path, tmp_path))
    reporter.open()
    assert str(path) not in {file.path for file in psutil.Process().open_files()}
    assert reporter.paths() == ()


def test_a_story_is_kept_whole(reports: Any, story: Any, tmp_path: Path):
    """The history has a retried test, a test that never ran, an infinite value, and text that is not valid Unicode."""
    story.begin(("s", 3), robot="\udc80")
    story.start("s").test("s/t1", Verdict.FAILED, final=False).test("s/t1", Verdict.FLAKY, attempt=2)
    story.test("s/t2", Verdict.PASSED, Measured(test="s/t2", name="error", value=float("inf")))
    story.end("s").finish()
    path = reports("history", story, target=tmp_path / "h.sqlite", journal=True)
    ((run, tests, measured),) = kept(path)
    assert run.robot == "\\udc80"
    assert tests == {"s/t1": "flaky", "s/t2": "passed", "s/t3": "not run"}
    assert measured == {":error": None}
