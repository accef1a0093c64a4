"""The status of a run for scripts: the running tests, and a number for each test, as in the C++ framework."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

from rtf.testing.journal import JournalReader
from rtf.testing.results import RunResult, TestResult
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from pathlib import Path

NOT_RUN, RUNNING, FAILED, PASSED = range(4)


class Status:
    """The status by a journal; reads the lines appended since the last call. For any thread."""

    def __init__(self, path: Path) -> None:
        self._reader = JournalReader(path)
        self._lock = threading.Lock()
        self._results = RunResult()

    def suites(self) -> frozenset[str]:
        """The suites of the run."""
        with self._lock:
            return frozenset(self._up_to_date().suites)

    def rig(self) -> tuple[str, str]:
        """Robot and station of the run."""
        with self._lock:
            started = self._up_to_date().started
            return (started.robot, started.station) if started is not None else ("", "")

    def read(self) -> dict[str, Any]:
        """The two keys of ``GET /status``: the test that was started last and is running, or its suite; the numbers."""
        with self._lock:
            results = self._up_to_date()
            tests = [*results.tests.values()]
            running = [(test.started or 0.0, test.name) for test in tests if test.running]
            begun = [(suite.started, suite.name) for suite in results.suites.values() if suite.started is not None]
            _, name = max(running or begun, default=(0.0, ""))
            return {"name": name, "testStatus": [_number(test) for test in tests]}

    def _up_to_date(self) -> RunResult:
        if self._reader.path.exists():  # otherwise the run has not begun
            for event in self._reader.new_events():
                self._results.apply(event)
        return self._results


def _number(test: TestResult) -> int:
    if test.running:
        return RUNNING
    if test.last is None or test.last.verdict is Verdict.NOT_RUN:
        return NOT_RUN
    return PASSED if test.last.verdict.good else FAILED
