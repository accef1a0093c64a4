"""``testrunner page``: it shows a run from its folder, finished or not, without control."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from harness import run_command, write_files
from live_page import WAITING, LiveRun, Page
from rtf.testing.verdict import ExitCode

FINE = "from rtf.testing import TestCase\nclass Fine(TestCase):\n    def run(self):\n        self.check(True, 'fine')\n"


class Viewer:
    """The command, and its page."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "rtf", "page", *arguments, "--web-port", "0"],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert self.process.stderr is not None
        self.page = Page.said(self.process.stderr.readline())

    def end(self, signum: int = signal.SIGINT) -> tuple[int, str]:
        """Send a signal; return the exit code, and the rest of the error output."""
        self.process.send_signal(signum)
        said = self.process.communicate(timeout=20)[1]
        return self.process.returncode, said


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with plug-ins."""
    write_files(tmp_path, {"fine__py": FINE, "waiting__py": WAITING})
    return tmp_path


def test_a_run_that_is_over_is_shown(folder: Path):
    """A finished run is shown to its end, and cannot be controlled."""
    run_command(folder, "-t", "fine.py", "--run-folder", "run", "--no-output")
    viewer = Viewer(folder, "run", "--compare", "run/journal.jsonl")
    with viewer.page.follow() as stream:
        records = stream.until_end()
    assert records == [json.loads(line) for line in (folder / "run" / "journal.jsonl").read_text().splitlines()]
    facts = viewer.page.get("/facts").json
    assert (facts["control"], facts["compare"]) == (False, True)
    assert viewer.page.get("/compare").json[-1]["event"] == "run_ended"
    assert viewer.page.control("stop", stage=1).status == 401
    assert viewer.end() == (ExitCode.PASSED, "")


def test_a_run_that_goes_on_is_followed(folder: Path):
    """A running run is followed to its end, without an effect on it."""
    run = LiveRun(folder, "-t", "waiting.py", "--no-output")
    with run.page.follow() as stream:
        stream.until(event="asked")
        viewer = Viewer(folder, "rtf-runs/latest")
        with viewer.page.follow() as other:
            other.until(event="asked")
            run.page.control("answer", test="test/waiting", question="test/waiting#1", answer="yes")
            assert other.until_end()[-1]["event"] == "run_ended"
        stream.until_end()
    assert run.wait().exit_code == ExitCode.PASSED
    assert viewer.end(signal.SIGTERM)[0] in (ExitCode.PASSED, -signal.SIGTERM)


@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM])
def test_it_ends_at_once_also_before_an_audience(folder: Path, signum: signal.Signals):
    """A signal ends the command at once and silently, also with open pages."""
    (folder / "journal.jsonl").write_text('{"event":"run_started","seq":1}\n')
    viewer = Viewer(folder, ".")
    with viewer.page.follow() as one, viewer.page.follow() as other:
        assert len(one.until_end()) == len(other.until_end()) == 1
        code, said = viewer.end(signum)
    assert code in (ExitCode.PASSED, -signum)
    assert said == ""


def test_a_torn_line_is_not_shown(folder: Path):
    """The last line of a journal is not shown if it is incomplete."""
    (folder / "journal.jsonl").write_text('{"event":"run_started","seq":1}\n{"event":"mess')
    viewer = Viewer(folder, ".")
    with viewer.page.follow() as stream:
        assert stream.until_end() == [{"event": "run_started", "seq": 1}]
    viewer.end()


def test_what_is_no_run_is_an_error(folder: Path):
    """The error about a folder without a run names the path."""
    outcome = run_command(folder, "page", "nothing-here", "--web-port", "0")
    assert outcome.exit_code == ExitCode.USAGE
    assert "there is no run in nothing-here" in outcome.stderr
