"""The file of the history: opened by several testrunners at a time, and readable by any SQLite tool.

A run is added whole, in one transaction, or not at all; a run that is added again replaces the old one. Its tests come
from its results, its measurements from its journal; of a test that was tried several times the last attempt counts.
``trends`` evaluates the rows over time.

The version of the tables is in ``user_version``, and ``application_id`` marks the file as ours. A step from one version
to the next, once released, is never changed; a new version is a new step.
"""

from __future__ import annotations

import json
import math
import os
import sqlite3
from collections import Counter
from contextlib import contextmanager
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Self

from rtf import clock
from rtf.testing import journal
from rtf.testing.events import Event, Measured, RunStarted, TestEnded, TestStarted
from rtf.testing.report.text import without_surrogates as text
from rtf.testing.suite.ids import renewed
from rtf.testing.verdict import TestingError, Verdict

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from types import TracebackType

    from rtf.testing.results import RunResult, TestResult

FILE_NAME = "history.sqlite"

#: Seconds to wait for another writer. The largest runs take one or two to be put in.
_PATIENCE = 10.0


#: "RTFH" in the header of the file.
_APPLICATION = 0x52544648

#: The steps from version 0, an empty file, to 1, and so on. Rows are in the order of their keys, so that what belongs
#: to a run, a test or a measurement is read in one go and needs no index beside it.
STEPS: tuple[tuple[str, ...], ...] = (
    (
        """CREATE TABLE runs (
            id INTEGER PRIMARY KEY,
            run TEXT NOT NULL,          -- name of the run's folder
            folder TEXT NOT NULL,       -- where it was when the run was recorded
            started REAL NOT NULL,      -- seconds since 1970
            ended REAL,
            duration REAL,              -- seconds
            verdict TEXT NOT NULL,
            exit_code INTEGER NOT NULL,
            robot TEXT NOT NULL,
            station TEXT NOT NULL,
            version TEXT NOT NULL,      -- of RTF
            seed INTEGER,
            host TEXT NOT NULL,
            user TEXT NOT NULL,
            command TEXT NOT NULL,      -- JSON array of words
            UNIQUE (run, started, station)
        )""",
        "CREATE INDEX runs_of_a_robot ON runs (robot, station, started)",
        """CREATE TABLE tests (
            run INTEGER NOT NULL REFERENCES runs ON DELETE CASCADE,
            test TEXT NOT NULL,         -- suite/test
            name TEXT NOT NULL,
            suite TEXT NOT NULL,
            verdict TEXT NOT NULL,
            outcome TEXT NOT NULL,      -- of the last attempt
            attempts INTEGER NOT NULL,
            duration REAL,              -- seconds over all attempts
            reason TEXT NOT NULL,
            PRIMARY KEY (run, test)
        ) WITHOUT ROWID""",
        """CREATE TABLE measurements (
            run INTEGER NOT NULL REFERENCES runs ON DELETE CASCADE,
            test TEXT NOT NULL,
            subject TEXT NOT NULL,
            name TEXT NOT NULL,
            repetition INTEGER NOT NULL, -- counts from 0 what was measured more than once
            value REAL,                  -- NULL if it was no finite number, and then
            not_finite TEXT,             -- NaN, Infinity or -Infinity
            unit TEXT NOT NULL,
            low REAL,
            high REAL,
            marginal REAL,
            verdict TEXT NOT NULL,
            PRIMARY KEY (run, test, subject, name, repetition)
        ) WITHOUT ROWID""",
    ),
    (  # ids were made of names alone, in lower case; ``renewed_id`` is the function of ``rtf.testing.suite.ids``
        """CREATE TEMPORARY TABLE renewed AS
            SELECT run, test AS old, renewed_id(test, suite, name) AS new FROM tests""",
        "DELETE FROM temp.renewed WHERE old = new",
        """UPDATE OR IGNORE measurements SET test = renewed.new FROM temp.renewed
            WHERE measurements.run = renewed.run AND measurements.test = renewed.old""",
        """UPDATE OR IGNORE tests SET test = renewed.new FROM temp.renewed
            WHERE tests.run = renewed.run AND tests.test = renewed.old""",
        "DROP TABLE temp.renewed",
    ),
    (  # what a campaign needs, see ``rtf.campaigns.store``
        "ALTER TABLE tests ADD COLUMN processor REAL",  # seconds of the processor over all attempts
        "ALTER TABLE tests ADD COLUMN named TEXT",  # the subject of the first failure of the last attempt
        """CREATE TABLE tasks (
            id INTEGER PRIMARY KEY,
            key TEXT NOT NULL UNIQUE,   -- digest of the task
            task TEXT NOT NULL,         -- JSON object
            robot TEXT NOT NULL,        -- name of the real robot; empty: none is moved
            state TEXT NOT NULL,        -- waiting, running, done, killed, broken, lost, refused
            attempts INTEGER NOT NULL,  -- how often it was begun and did not end
            detail TEXT NOT NULL,       -- why it did not end
            seconds REAL,               -- what it took, with the start of its runner
            run INTEGER REFERENCES runs ON DELETE CASCADE
        )""",
        "CREATE INDEX tasks_in_a_state ON tasks (state, robot, attempts, id)",
        "CREATE INDEX task_of_a_run ON tasks (run)",
        """CREATE TABLE journals (
            task INTEGER PRIMARY KEY REFERENCES tasks ON DELETE CASCADE,
            journal BLOB NOT NULL       -- compressed by zlib
        )""",
    ),
)


class HistoryError(TestingError, OSError):
    """The history cannot be read or written."""


@dataclass(frozen=True, slots=True)
class StoredRun:
    """A row of the table ``runs`` without its number; ``command`` is a JSON array."""

    run: str
    folder: str
    started: float
    ended: float | None
    duration: float | None
    verdict: str
    exit_code: int
    robot: str
    station: str
    version: str
    seed: int | None
    host: str
    user: str
    command: str


#: ``test, name, suite, verdict, outcome, attempts, duration, reason``.
TestRow = tuple[str, str, str, str, str, int, float, str]
#: ``processor, named``, which follow a TestRow when it is written.
NewTestRow = tuple[str, str, str, str, str, int, float, str, float, str | None]
#: ``test, subject, name, repetition, value, not_finite, unit, low, high, marginal, verdict``.
MeasurementRow = tuple[str, str, str, int, float | None, str | None, str, float | None, float | None, float | None, str]

_RUN_COLUMNS = ", ".join(StoredRun.__dataclass_fields__)


def default_place() -> Path:
    """Return the default path of the history, in the user's data folder."""
    import platformdirs

    return Path(platformdirs.user_data_dir("rtf", appauthor=False)) / FILE_NAME


class History:
    """An open history. ``create`` makes file and folder where there are none; otherwise that is an error.

    To be used by one thread at a time. Every method raises HistoryError, which names the file and the hint.
    """

    def __init__(self, path: Path, *, create: bool = False) -> None:
        self.path = path
        if not create and not path.exists():
            raise HistoryError(
                f"there is no history {path} yet: run tests with --history, or take archived runs in with "
                "'testrunner history --import RUN...'"
            )
        with self._translate_errors():
            if create:
                path.parent.mkdir(parents=True, exist_ok=True)
            self._read_only = not create and not _is_writable(path)
            self._connection = _connect(path, create=create, read_only=self._read_only)
            try:
                self._prepare()
            except BaseException:
                self._connection.close()
                raise

    def _prepare(self) -> None:
        connection = self._connection
        connection.execute("PRAGMA foreign_keys = ON")
        version = _version(connection)
        if version is None:
            raise self._error("it is a database of something else; name another file")
        if version > len(STEPS):
            known = f"it is of version {version}, and this RTF knows {len(STEPS)}"
            raise self._error(f"{known}; use the newer RTF that made it, or another file")
        if version == len(STEPS) or (version and self._read_only):  # older rows can be read, under their older ids
            return
        _write_ahead(connection)
        with self.transaction():
            migrate(connection, STEPS)

    def check_writable(self) -> None:
        """Raise HistoryError when the file can never be written. Another writer at work is no hindrance."""
        with self._translate_errors():
            self._connection.execute("PRAGMA busy_timeout = 0")
            try:
                self._connection.execute("BEGIN IMMEDIATE")
                self._connection.execute("ROLLBACK")
            except sqlite3.OperationalError as error:
                if error.sqlite_errorcode != sqlite3.SQLITE_BUSY:
                    raise
            finally:
                self._connection.execute(f"PRAGMA busy_timeout = {int(_PATIENCE * 1000)}")

    # Writing -----------------------------------------------------------------------------------------------------

    def record(self, run: StoredRun, tests: Iterable[NewTestRow], measurements: Iterable[MeasurementRow]) -> int:
        """Add a run, whole, and replace the same run if it is there. Returns its number."""
        with self.transaction():
            execute, many = self._connection.execute, self._connection.executemany
            execute(
                "DELETE FROM runs WHERE run = ? AND started = ? AND station = ?", (run.run, run.started, run.station)
            )
            values = astuple(run)
            marks = ", ".join("?" * len(values))
            number = execute(f"INSERT INTO runs ({_RUN_COLUMNS}) VALUES ({marks})", values).lastrowid  # noqa: S608
            assert number is not None
            many(
                "INSERT OR REPLACE INTO tests (run, test, name, suite, verdict, outcome, attempts, duration, reason, "
                "processor, named) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                ((number, *row) for row in tests),
            )
            many(
                "INSERT OR REPLACE INTO measurements VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                ((number, *row) for row in measurements),
            )
            return number

    def forget(self, run: str) -> int:
        """Remove all runs of this name; returns how many there were."""
        with self.transaction():
            return self._connection.execute("DELETE FROM runs WHERE run = ?", (run,)).rowcount

    def prune(self, keep: int) -> int:
        """Keep the newest runs of each robot on each station, and free the space of the others."""
        with self._translate_errors():
            with self.transaction():
                gone = self._connection.execute(
                    "DELETE FROM runs WHERE id IN (SELECT id FROM (SELECT id, row_number() OVER "
                    "(PARTITION BY robot, station ORDER BY started DESC, id DESC) AS place FROM runs) WHERE place > ?)",
                    (keep,),
                ).rowcount
            if gone:
                self._connection.execute("VACUUM")
            return gone

    # Reading -----------------------------------------------------------------------------------------------------

    def runs(self, robot: str = "*", station: str = "*") -> list[tuple[int, StoredRun]]:
        """The runs with their numbers, newest first. Robot and station may be patterns with ``*`` and ``?``."""
        with self._translate_errors():
            rows = self._connection.execute(
                f"SELECT id, {_RUN_COLUMNS} FROM runs WHERE (robot = ?1 OR robot GLOB ?1) "  # noqa: S608
                "AND (station = ?2 OR station GLOB ?2) ORDER BY started DESC, id DESC",
                (robot, station),
            )
            return [(row[0], StoredRun(*row[1:])) for row in rows]

    def tests(self, number: int) -> list[TestRow]:
        """The tests of a run, in the order of their ids."""
        with self._translate_errors():
            return self._connection.execute(
                "SELECT test, name, suite, verdict, outcome, attempts, duration, reason FROM tests WHERE run = ?",
                (number,),
            ).fetchall()

    def measurements(self, number: int) -> list[MeasurementRow]:
        """The measurements of a run, in the order of test, subject, name and repetition."""
        with self._translate_errors():
            return self._connection.execute(
                "SELECT test, subject, name, repetition, value, not_finite, unit, low, high, marginal, verdict "
                "FROM measurements WHERE run = ?",
                (number,),
            ).fetchall()

    @property
    def is_campaign(self) -> bool:
        """Whether this is the file of a campaign."""
        with self._translate_errors():
            return self._has_tasks() and self._connection.execute("SELECT 1 FROM tasks LIMIT 1").fetchone() is not None

    def faulty(self) -> frozenset[int]:
        """Return the numbers of the runs of a campaign in which the robot had a fault."""
        with self._translate_errors():
            if not self._has_tasks():
                return frozenset()
            rows = self._connection.execute(
                "SELECT run FROM tasks WHERE run IS NOT NULL AND json_extract(task, '$.fault') IS NOT NULL"
            )
            return frozenset(number for (number,) in rows)

    def _has_tasks(self) -> bool:
        """Return whether there is the table of tasks; a file that is older, and can only be read, has none."""
        return self._connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'tasks'").fetchone() is not None

    @contextmanager
    def snapshot(self) -> Iterator[None]:
        """Show one state of the file throughout the block, whatever other processes write meanwhile."""
        with self._translate_errors():
            self._connection.execute("BEGIN")
        try:
            yield
        finally:
            self._connection.execute("ROLLBACK")

    # Opening and closing -----------------------------------------------------------------------------------------

    def close(self) -> None:
        """Close the file."""
        with self._translate_errors():
            self._connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Write all that the block writes, or nothing of it. A transaction in another one is a part of that."""
        with self._translate_errors():
            if self._connection.in_transaction:
                yield
            else:
                with self._whole():
                    yield

    @contextmanager
    def _whole(self) -> Iterator[None]:
        self._connection.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._connection.execute("COMMIT")
        except BaseException:
            if self._connection.in_transaction:
                self._connection.execute("ROLLBACK")
            raise

    @contextmanager
    def _translate_errors(self) -> Iterator[None]:
        """Add the file and a hint to errors in the block."""
        try:
            yield
        except sqlite3.Error as error:
            raise self._error(f"{error}; {_hint(error)}") from error
        except TestingError:
            raise
        except OSError as error:
            raise self._error(f"{error.strerror}; {_ELSEWHERE}") from None

    def _error(self, reason: str) -> HistoryError:
        return HistoryError(f"cannot use the history {self.path}: {reason}")


_ELSEWHERE = "name a file that can be written with --history FILE"
_HINTS = {
    "SQLITE_BUSY": "another program holds it; try again when that is done",
    "SQLITE_NOTADB": "move it away; 'testrunner history --import RUN...' makes it anew from archived runs",
    "SQLITE_CORRUPT": "move it away; 'testrunner history --import RUN...' makes it anew from archived runs",
    "SQLITE_FULL": "make room on the disk, or keep fewer runs with 'testrunner history --prune N'",
    "SQLITE_ERROR": "its tables are not as they were made: move it away",
}


def _hint(error: sqlite3.Error) -> str:
    name: str = getattr(error, "sqlite_errorname", "")
    return next((hint for start, hint in _HINTS.items() if name.startswith(start)), _ELSEWHERE)


def _is_writable(path: Path) -> bool:
    return os.access(path, os.W_OK) and os.access(path.absolute().parent, os.W_OK)


def _connect(path: Path, *, create: bool, read_only: bool) -> sqlite3.Connection:
    """Open the file, read-only if it cannot be written, as on a stick or in an archive."""
    mode = "rwc" if create else "rw"
    if read_only:
        # Rows in the write-ahead log can be read only with files beside it, which cannot be made there.
        mode = "ro" if path.with_name(f"{path.name}-wal").exists() else "ro&immutable=1"
    return sqlite3.connect(
        f"{path.absolute().as_uri()}?mode={mode}",
        uri=True,
        timeout=_PATIENCE,
        isolation_level=None,
        check_same_thread=False,
    )


def _write_ahead(connection: sqlite3.Connection) -> None:
    """Use a write-ahead log, so that readers and a writer do not wait for each other, where that is possible.

    A file system without shared memory has none. SQLite does not wait here for processes that do the same, so this
    function does.
    """
    deadline = clock.Deadline.after(_PATIENCE)
    while True:
        try:
            connection.execute("PRAGMA journal_mode = WAL")
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode != sqlite3.SQLITE_BUSY or deadline.expired:
                raise
            clock.sleep(0.01)
        else:
            return


def _version(connection: sqlite3.Connection) -> int | None:
    """Return the version of an open file: 0 if it is empty, None if it is not ours."""
    began = not connection.in_transaction
    if began:
        connection.execute("BEGIN")  # one look at all three: another process may be making the file right now
    try:
        (application,) = connection.execute("PRAGMA application_id").fetchone()
        (version,) = connection.execute("PRAGMA user_version").fetchone()
        (tables,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    finally:
        if began and connection.in_transaction:
            connection.execute("ROLLBACK")
    return None if application != _APPLICATION and (application or version or tables) else int(version)


def migrate(connection: sqlite3.Connection, steps: Sequence[Sequence[str]]) -> None:
    """Bring a file of RTF up to the version of the last step. To be called in a transaction that may write."""
    done = _version(connection) or 0
    if done >= len(steps):  # another process was faster
        return
    connection.create_function("renewed_id", 3, renewed, deterministic=True)
    for step in steps[done:]:
        for statement in step:
            connection.execute(statement)
    connection.execute(f"PRAGMA application_id = {_APPLICATION}")
    connection.execute(f"PRAGMA user_version = {len(steps)}")


# From a run to its rows ----------------------------------------------------------------------------------------------


def import_run(history: History, path: Path) -> RunResult:
    """Add an archived run, by its folder or journal, and return its results.

    Raises JournalError and EventError for a file that is no run, and HistoryError.
    """
    results = journal.results_of(path)
    record_run(history, path, results)
    return results


def record_run(history: History, path: Path, results: RunResult) -> int | None:
    """Add a run with these results, and return its number; None if it has not begun. Raises as ``import_run``."""
    events = journal.as_one_run(path)
    first = next((event for event in events if isinstance(event, RunStarted)), None)  # of one that was resumed, too
    if first is None:
        return None
    run = _run(first, results, path if path.is_dir() else path.parent)
    return history.record(run, map(_test, results.tests.values()), _measurements(events, results))


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


def _test(test: TestResult) -> NewTestRow:
    verdict = test.verdict or Verdict.NOT_RUN
    last = test.last
    outcome, reason = (last.outcome, last.reason) if last else (verdict, "")
    suite, tried = test.planned.suite, _attempts(test)
    processor = sum(attempt.cpu_time for attempt in test.attempts)
    named = next((text(problem.subject) for problem in test.problems if problem.subject), None)
    row = text(test.id), text(test.name), text(suite), verdict, outcome, tried, test.duration, text(reason)
    return *row, processor, named


def _attempts(test: TestResult) -> int:
    return sum(attempt.attempt > 0 for attempt in test.attempts)


def _measurements(events: Iterator[Event], results: RunResult) -> Iterator[MeasurementRow]:
    tried = {text(test): _attempts(result) for test, result in results.tests.items()}  # a journal has escaped texts
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
    """Return a limit, or None for one at infinity."""
    return None if value is None or not math.isfinite(value) else float(value)
