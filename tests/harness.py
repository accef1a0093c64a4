"""Real runs for tests: a suite and its plug-ins are written to a folder and run, and what happened is read back."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import psutil

from rtf import clock
from rtf.testing import journal
from rtf.testing.broadcast import Broadcast
from rtf.testing.plan import Planner, load_files
from rtf.testing.results import RunResult
from rtf.testing.run_state import RunOptions
from rtf.testing.runner import Run

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from rtf.testing.events import Event
    from rtf.testing.suite_worker import SuiteWorker
    from rtf.testing.verdict import Verdict

#: Every process of a run started here carries this variable, so that a test can say that none is left.
MARK = "RTF_TEST_MARK"


@dataclass
class Outcome:
    """The outcome of a run: exit code, events of its journal, results, and output."""

    exit_code: int
    folder: Path
    events: list[Event] = field(default_factory=list)
    results: RunResult = field(default_factory=RunResult)
    stdout: str = ""
    stderr: str = ""

    def of(self, kind: type[Event], **members: object) -> list[Event]:
        """Return the events of one class with these values of members."""
        return [
            event
            for event in self.events
            if isinstance(event, kind) and all(getattr(event, name) == value for name, value in members.items())
        ]

    def verdict(self, name: str) -> Verdict | None:
        """Return the verdict of the test whose id ends with this name."""
        found = [test for test_id, test in self.results.tests.items() if test_id.rpartition("/")[2] == name]
        assert len(found) == 1, f"{name!r} is not one of {[*self.results.tests]}"
        return found[0].verdict

    def detail(self, name: str) -> str:
        """Return the detail of the last attempt of the test whose id ends with this name."""
        (found,) = [test for test_id, test in self.results.tests.items() if test_id.rpartition("/")[2] == name]
        assert found.last is not None
        return found.last.detail


def write_files(folder: Path, files: dict[str, str]) -> None:
    """Write files by name; ``stem__suffix`` stands for ``stem.suffix``."""
    for name, text in files.items():
        path = folder / name.replace("__", ".")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        if text.startswith("#!"):
            path.chmod(0o755)


def read_back(folder: Path) -> tuple[list[Event], RunResult]:
    """Return the events of a run's journal, and its results."""
    events = [*journal.read(folder)]
    return events, RunResult.of(events)


def run_suite(
    tmp_path: Path,
    xml: str,
    *,
    interfere: Callable[[Run], None] | None = None,
    options: dict[str, object] | None = None,
    conduct: Callable[[SuiteWorker], None] | None = None,
    **files: str,
) -> Outcome:
    """Run a suite in this process, without taking signals. ``interfere`` is called with the run before it begins.

    ``xml`` is the inside of the suite element, or a whole document; ``files`` are written beside it.
    """
    folder = tmp_path / "suite"
    folder.mkdir(exist_ok=True)
    write_files(folder, files)
    text = xml if xml.lstrip().startswith(("<suite", "<?xml")) else f'<suite name="s">{xml}</suite>'
    suite = folder / "suite.xml"
    suite.write_text(text, encoding="utf-8")
    loaded = load_files([(suite, True)], {})
    assert not loaded.has_errors, loaded.diagnostics
    suites = Planner().plan(loaded.suites)
    run_folder = tmp_path / "run"
    run_folder.mkdir()
    broadcast = Broadcast(journal.Journal(run_folder / journal.FILE_NAME), [])
    run = Run(
        suites, RunOptions(run_folder=run_folder, handle_signals=False, **(options or {})), broadcast, None, conduct
    )  # type: ignore[arg-type]
    if interfere is not None:
        interfere(run)
    code = run.execute(loaded.diagnostics)
    events, results = read_back(run_folder)
    return Outcome(int(code), run_folder, events, results)


class Command:
    """``testrunner`` as a process in a folder; an environment variable marks its descendants."""

    def __init__(self, folder: Path, *arguments: str, **environment: str) -> None:
        self.folder = folder
        self.mark = f"{os.getpid()}-{id(self)}"
        self.process = subprocess.Popen(
            [sys.executable, "-m", "rtf.cli.testrunner", *arguments],
            cwd=folder,
            env={**os.environ, "NO_COLOR": "1", MARK: self.mark, **environment},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="backslashreplace",
        )

    def wait(self, timeout: float = 60.0) -> Outcome:
        """Wait for the end; the journal is that of ``rtf-runs/latest`` where there is one."""
        stdout, stderr = self.process.communicate(timeout=timeout)
        run_folder = self.folder / "rtf-runs" / "latest"
        begun = (run_folder / journal.FILE_NAME).exists()
        events, results = read_back(run_folder) if begun else ([], RunResult())
        return Outcome(self.process.returncode, run_folder, events, results, stdout, stderr)

    def signal(self, signum: int = signal.SIGINT) -> None:
        """Send a signal to the runner only."""
        self.process.send_signal(signum)

    def wait_for(self, condition: Callable[[list[Event]], bool], timeout: float = 30.0) -> list[Event]:
        """Wait until the journal so far meets a condition."""
        path = self.folder / "rtf-runs" / "latest" / journal.FILE_NAME
        deadline = clock.Deadline.after(timeout)
        while not deadline.expired:
            events = [*journal.read(path)] if path.exists() else []
            if condition(events):
                return events
            if self.process.poll() is not None:
                raise AssertionError(f"the run ended before: {self.process.communicate()}")
            clock.sleep(0.005)
        raise AssertionError("the condition did not come about in time")

    def left_over(self, timeout: float = 10.0) -> list[psutil.Process]:
        """Return the processes of this run that still exist after some time."""
        deadline = clock.Deadline.after(timeout)
        while True:
            found = marked(self.mark)
            if not found or deadline.expired:
                return found
            clock.sleep(0.01)


def marked(mark: str) -> list[psutil.Process]:
    """Return the running processes with this mark."""
    found = []
    for process in psutil.process_iter():
        try:
            if process.environ().get(MARK) == mark and process.status() != psutil.STATUS_ZOMBIE:
                found.append(process)
        except (psutil.NoSuchProcess, psutil.AccessDenied, OSError):
            continue
    return found


def run_command(folder: Path, *arguments: str, limit: float = 60.0, **environment: str) -> Outcome:
    """Run ``testrunner`` to its end."""
    return Command(folder, *arguments, **environment).wait(limit)
