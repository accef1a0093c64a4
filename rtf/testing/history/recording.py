"""From a run to its rows in the history: tests from its results, measurements from its journal.

Of a test that was tried several times the last attempt counts.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from typing import TYPE_CHECKING

from rtf.testing import journal
from rtf.testing.events import Event, Measured, RunStarted, TestEnded, TestStarted
from rtf.testing.history.database import History, StoredRun
from rtf.testing.report.text import without_surrogates as text
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from rtf.testing.history.database import MeasurementRow, TestRow
    from rtf.testing.results import RunResult, TestResult


def import_run(history: History, path: Path) -> RunResult:
    """Put an archived run in, by its folder or journal, and return its results.

    Raises JournalError and EventError for what is no run, and HistoryError.
    """
    results = journal.results_of(path)
    record_run(history, path, results)
    return results


def record_run(history: History, path: Path, results: RunResult) -> None:
    """Put a run in that has come to these results; one that has not begun is not put in. Raises as ``import_run``."""
    events = journal.as_one_run(path)
    first = next((event for event in events if isinstance(event, RunStarted)), None)  # of one that was resumed, too
    if first is not None:
        run = _run(first, results, path if path.is_dir() else path.parent)
        history.record(run, map(_test, results.tests.values()), _measurements(events, results))


def _run(first: RunStarted, results: RunResult, folder: Path) -> StoredRun:
    ended = results.ended
    started, last = round(first.time, 6), round((ended or results.interrupted or first).time, 6)
    return StoredRun(
        run=text(first.run),
        folder=text(str(folder)),
        started=started,
        ended=last,
        duration=ended.duration if ended else last - started,
        verdict=ended.verdict if ended else results.verdict(),
        exit_code=ended.exit_code if ended else int(results.exit_code()),
        robot=text(first.robot),
        station=text(first.station),
        version=text(first.version),
        seed=first.seed,
        host=text(first.environment.get("host", "")),
        user=text(first.environment.get("user", "")),
        command=json.dumps(first.command),
    )


def _test(test: TestResult) -> TestRow:
    verdict = test.verdict or Verdict.NOT_RUN
    last = test.last
    outcome, reason = (last.outcome, last.reason) if last else (verdict, "")
    suite, tried = test.planned.suite, _attempts(test)
    return text(test.id), text(test.name), text(suite), verdict, outcome, tried, test.duration, text(reason)


def _attempts(test: TestResult) -> int:
    return sum(attempt.attempt > 0 for attempt in test.attempts)


def _measurements(events: Iterator[Event], results: RunResult) -> Iterator[MeasurementRow]:
    tried = {text(test): _attempts(result) for test, result in results.tests.items()}  # a journal has the texts mended
    begun: Counter[str] = Counter()
    repetitions: dict[str, Counter[tuple[str, str]]] = {}  # of the tests that are running
    for event in events:
        if not isinstance(event, TestStarted | TestEnded | Measured):
            continue
        test = text(event.test)
        if isinstance(event, TestStarted):
            begun[test] += 1
            repetitions[test] = Counter()
        elif isinstance(event, TestEnded):
            repetitions.pop(test, None)
        elif test in tried and begun[test] >= tried[test]:
            key = (text(event.subject), text(event.name))
            repeated = repetitions.setdefault(test, Counter())
            yield _measurement(event, *key, repeated[key])
            repeated[key] += 1


def _measurement(event: Measured, subject: str, name: str, repetition: int) -> MeasurementRow:
    value: float | None = float(event.value)
    special = None
    if not math.isfinite(event.value):
        value, special = None, "NaN" if math.isnan(event.value) else "Infinity" if event.value > 0 else "-Infinity"
    limits = (_limit(event.low), _limit(event.high), _limit(event.marginal))
    return text(event.test), subject, name, repetition, value, special, text(event.unit), *limits, event.verdict


def _limit(value: float | None) -> float | None:
    """A limit at infinity is none."""
    return None if value is None or not math.isfinite(value) else float(value)
