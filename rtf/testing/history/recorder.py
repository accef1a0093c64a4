"""From the events of a run to its rows in the history.

During the run measurements wait in a temporary file of its own, so that neither memory grows nor anybody waits for a
lock or a disk; tests are in the run's results anyway. Of a test that was tried several times the last attempt counts.
"""

from __future__ import annotations

import json
import math
import sqlite3
from typing import TYPE_CHECKING

from rtf.testing.events import Event, Measured, RunStarted, TestStarted
from rtf.testing.history.database import History, HistoryError, StoredRun
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from rtf.testing.history.database import MeasurementRow, TestRow
    from rtf.testing.results import RunResult, TestResult

#: So many measurements go to the temporary file at a time.
_BATCH = 500

_SpoolRow = tuple[str, int, str, str, float | None, str | None, str, float | None, float | None, float | None, str]


class Recorder:
    """Takes the events of one run in, and puts the run into a history when it is over."""

    def __init__(self) -> None:
        self._first: RunStarted | None = None
        self._last = 0.0
        self._attempts: dict[str, int] = {}
        self._waiting: list[_SpoolRow] = []
        self._spool = sqlite3.connect("", isolation_level=None, check_same_thread=False)  # "": a file without a name
        self._spool.execute("PRAGMA journal_mode = OFF")
        self._spool.execute(
            "CREATE TABLE measured "
            "(test, attempt, subject, name, value, not_finite, unit, low, high, marginal, verdict)"
        )
        self._spool.execute("BEGIN")

    def take(self, event: Event) -> None:
        """Take one event in. Raises HistoryError when there is no room for what has to wait."""
        self._last = event.time
        if isinstance(event, Measured):
            self._waiting.append(_spooled(event, self._attempts.get(event.test, 0)))
            if len(self._waiting) >= _BATCH:
                self._put_aside()
        elif isinstance(event, TestStarted):
            self._attempts[event.test] = self._attempts.get(event.test, 0) + 1
        elif isinstance(event, RunStarted) and self._first is None:  # a resumed run is the run that was begun
            self._first = event

    def save(self, history: History, results: RunResult, folder: Path) -> None:
        """Put the run into a history; one that has not begun has nothing to put. Raises HistoryError."""
        if self._first is None:
            return
        self._put_aside()
        run = self._run(self._first, results, folder)
        history.record(run, (_test(test) for test in results.tests.values()), self._measurements(results))

    def close(self) -> None:
        """Give the space back."""
        self._spool.close()

    def _put_aside(self) -> None:
        marks = "?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?"
        try:
            self._spool.executemany(f"INSERT INTO measured VALUES ({marks})", self._waiting)  # noqa: S608
        except sqlite3.Error as error:
            raise HistoryError(f"no room for measurements that wait for the run's end: {error}") from error
        self._waiting.clear()

    def _run(self, first: RunStarted, results: RunResult, folder: Path) -> StoredRun:
        ended = results.ended
        started, last = round(first.time, 6), round(ended.time if ended else self._last, 6)
        return StoredRun(
            run=_text(first.run),
            folder=_text(str(folder)),
            started=started,
            ended=last,
            duration=ended.duration if ended else last - started,
            verdict=ended.verdict if ended else results.verdict(),
            exit_code=ended.exit_code if ended else int(results.exit_code()),
            robot=_text(first.robot),
            station=_text(first.station),
            version=_text(first.version),
            seed=first.seed,
            host=_text(first.environment.get("host", "")),
            user=_text(first.environment.get("user", "")),
            command=json.dumps(first.command),
        )

    def _measurements(self, results: RunResult) -> Iterator[MeasurementRow]:
        last = {_text(test): attempt for test, attempt in self._attempts.items() if test in results.tests}
        rows = self._spool.execute(
            "SELECT attempt, test, subject, name, "
            "row_number() OVER (PARTITION BY test, attempt, subject, name ORDER BY rowid) - 1, "
            "value, not_finite, unit, low, high, marginal, verdict FROM measured"
        )
        return (row[1:] for row in rows if last.get(row[1]) == row[0])


def _spooled(event: Measured, attempt: int) -> _SpoolRow:
    value = float(event.value)
    special = None if math.isfinite(value) else "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    return (
        _text(event.test),
        attempt,
        _text(event.subject),
        _text(event.name),
        value if special is None else None,
        special,
        _text(event.unit),
        _limit(event.low),
        _limit(event.high),
        _limit(event.marginal),
        event.verdict,
    )


def _limit(value: float | None) -> float | None:
    """A limit at infinity is none."""
    return None if value is None or not math.isfinite(value) else float(value)


def _test(test: TestResult) -> TestRow:
    verdict = test.verdict or Verdict.NOT_RUN
    last = test.last
    return (
        _text(test.id),
        _text(test.name),
        _text(test.planned.suite),
        verdict,
        last.outcome if last else verdict,
        sum(attempt.attempt > 0 for attempt in test.attempts),
        test.duration,
        _text(last.reason) if last else "",
    )


def _text(text: str) -> str:
    """The text as a database can hold it: lone surrogates are written out, pairs of them are the character meant."""
    if text.isascii():
        return text
    try:
        text.encode()
    except UnicodeEncodeError:
        joined = text.encode("utf-16-le", "surrogatepass").decode("utf-16-le", "surrogatepass")
        return joined.encode("utf-8", "backslashreplace").decode()
    return text
