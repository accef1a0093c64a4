"""The status of a run for scripts: the running tests, and a number for each test, as in the C++ framework."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

from rtf.testing.events import (
    PlanChanged,
    RunStarted,
    SuitePlanned,
    SuiteStarted,
    TestEnded,
    TestPlanned,
    TestRenamed,
    TestStarted,
)
from rtf.testing.journal import JournalReader
from rtf.testing.suite.ids import program_of

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.testing.events import Event

NOT_RUN, RUNNING, FAILED, PASSED = range(4)
_NUMBERS = {"not run": NOT_RUN, **dict.fromkeys(("passed", "measured", "flaky", "skipped", "expected failure"), PASSED)}


class Status:
    """The status by a journal; reads the lines appended since the last call."""

    def __init__(self, path: Path) -> None:
        self._reader = JournalReader(path)
        self._lock = threading.Lock()
        self._names: dict[str, str] = {}
        self._tests: dict[str, int] = {}
        self._running: dict[str, None] = {}
        self._suite = ""
        self._suites: set[str] = set()
        self._rig = ("", "")

    def suites(self) -> frozenset[str]:
        """The suites of the run. All methods may be called from several threads."""
        with self._lock:
            self._catch_up()
            return frozenset(self._suites)

    def rig(self) -> tuple[str, str]:
        """Robot and station of the run."""
        with self._lock:
            self._catch_up()
            return self._rig

    def read(self) -> dict[str, Any]:
        """The two keys of ``GET /status``."""
        with self._lock:
            self._catch_up()
            current = next(reversed(self._running), self._suite)
            return {"name": self._names.get(current, current), "testStatus": [*self._tests.values()]}

    def _catch_up(self) -> None:
        if self._reader.path.exists():  # otherwise the run has not begun
            for event in self._reader.new_events():
                self._take(event)

    def _take(self, event: Event) -> None:
        if isinstance(event, RunStarted):
            self._rig = (event.robot, event.station)
        elif isinstance(event, SuitePlanned):
            self._suites.add(event.suite)
            self._names[event.suite] = event.name
        elif isinstance(event, SuiteStarted):
            self._suite = event.suite
        elif isinstance(event, TestPlanned):
            self._names[event.test] = event.name
            self._tests.setdefault(event.test, NOT_RUN)
        elif isinstance(event, PlanChanged):
            for test in [test for test in self._tests if program_of(test) in event.removed]:
                del self._tests[test]
        elif isinstance(event, TestRenamed):
            self._names[event.test] = event.name
        elif isinstance(event, TestStarted):
            self._tests[event.test] = RUNNING
            self._running[event.test] = None
        elif isinstance(event, TestEnded):
            self._running.pop(event.test, None)
            self._tests[event.test] = _NUMBERS.get(event.verdict, FAILED)
