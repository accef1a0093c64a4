"""The status of a run for scripts: what runs now, and a number for each test, as in the C++ framework."""

from __future__ import annotations

import json
import threading
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

NOT_RUN, RUNNING, FAILED, PASSED = range(4)
_NUMBERS = {"not run": NOT_RUN, **dict.fromkeys(("passed", "measured", "flaky", "skipped", "expected failure"), PASSED)}
_KINDS = frozenset(
    {"run_started", "suite_planned", "suite_started", "test_planned", "test_started", "test_renamed", "test_ended"}
)
_WORDS = tuple(f'"{kind}"'.encode() for kind in sorted(_KINDS))
#: A kind stands at the beginning of its line; what a test said may hold the same word, further on.
_BEGINNING = 40


class Status:
    """Follows a journal; reads what was appended since the last time, when it is asked."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = threading.Lock()
        self._offset = 0
        self._names: dict[str, str] = {}
        self._tests: dict[str, int] = {}
        self._running: dict[str, None] = {}
        self._suite = ""
        self._suites: set[str] = set()
        self._rig = ("", "")

    def suites(self) -> frozenset[str]:
        """The suites of the run. Safe to call from several threads, as everything here."""
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
        try:
            stream = self._path.open("rb")
        except FileNotFoundError:
            return
        with stream:
            stream.seek(self._offset)
            for line in stream:
                if not line.endswith(b"\n"):
                    return
                self._offset += len(line)
                if any(word in line[:_BEGINNING] for word in _WORDS):
                    self._take(json.loads(line))

    def _take(self, record: dict[str, Any]) -> None:
        kind, test, suite = record["event"], record.get("test", ""), record.get("suite", "")
        if kind == "run_started":
            self._rig = (record.get("robot", ""), record.get("station", ""))
        elif kind == "suite_planned":
            self._suites.add(suite)
            self._names[suite] = record["name"]
        elif kind == "suite_started":
            self._suite = suite
        elif kind == "test_planned":
            self._names[test] = record["name"]
            self._tests.setdefault(test, NOT_RUN)
        elif kind == "test_renamed":
            self._names[test] = record["name"]
        elif kind == "test_started":
            self._tests[test] = RUNNING
            self._running[test] = None
        elif kind == "test_ended":
            self._running.pop(test, None)
            self._tests[test] = _NUMBERS.get(record["verdict"], FAILED)
