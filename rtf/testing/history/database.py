"""The file of the history: opened by several testrunners at a time, and readable by any SQLite tool.

A run is put in whole, in one transaction, or not at all; a run that is put in again takes the place of what was there.
What the rows mean over time is the matter of ``trends``; where they come from is that of ``recorder``.
"""

from __future__ import annotations

import os
import sqlite3
from contextlib import contextmanager
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Self

from rtf import clock
from rtf.testing.history.schema import STEPS, ForeignFileError, migrate, version_of
from rtf.testing.outcome import TestingError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from types import TracebackType

FILE_NAME = "history.sqlite"

#: Seconds to wait for another writer. The largest runs take one or two to be put in.
_PATIENCE = 10.0


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
#: ``test, subject, name, repetition, value, not_finite, unit, low, high, marginal, verdict``.
MeasurementRow = tuple[str, str, str, int, float | None, str | None, str, float | None, float | None, float | None, str]

_RUN_COLUMNS = ", ".join(StoredRun.__dataclass_fields__)


def default_place() -> Path:
    """Where the history is when nobody says otherwise: a file of the user's."""
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
        with self._telling():
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
        version = version_of(connection, len(STEPS))
        if version == len(STEPS) or (version and self._read_only):  # older rows can be read, under their older ids
            return
        _write_ahead(connection)
        with self._transaction():
            migrate(connection, STEPS)

    def check_writable(self) -> None:
        """Raise HistoryError when nothing could ever be written. Another writer at work is no hindrance."""
        with self._telling():
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

    def record(self, run: StoredRun, tests: Iterable[TestRow], measurements: Iterable[MeasurementRow]) -> None:
        """Put a run in, whole, in the place of the same run if it is there."""
        with self._telling(), self._transaction():
            execute, many = self._connection.execute, self._connection.executemany
            execute(
                "DELETE FROM runs WHERE run = ? AND started = ? AND station = ?", (run.run, run.started, run.station)
            )
            values = astuple(run)
            marks = ", ".join("?" * len(values))
            number = execute(f"INSERT INTO runs ({_RUN_COLUMNS}) VALUES ({marks})", values).lastrowid  # noqa: S608
            many(
                "INSERT OR REPLACE INTO tests VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
                ((number, *row) for row in tests),
            )
            many(
                "INSERT INTO measurements VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                ((number, *row) for row in measurements),
            )

    def forget(self, run: str) -> int:
        """Take out all runs of this name; returns how many there were."""
        with self._telling(), self._transaction():
            return self._connection.execute("DELETE FROM runs WHERE run = ?", (run,)).rowcount

    def prune(self, keep: int) -> int:
        """Keep the newest runs of each robot on each station, and give the space of the others back."""
        with self._telling():
            with self._transaction():
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
        with self._telling():
            rows = self._connection.execute(
                f"SELECT id, {_RUN_COLUMNS} FROM runs WHERE (robot = ?1 OR robot GLOB ?1) "  # noqa: S608
                "AND (station = ?2 OR station GLOB ?2) ORDER BY started DESC, id DESC",
                (robot, station),
            )
            return [(row[0], StoredRun(*row[1:])) for row in rows]

    def tests(self, number: int) -> list[TestRow]:
        """The tests of a run, in the order of their ids."""
        with self._telling():
            return self._connection.execute(
                "SELECT test, name, suite, verdict, outcome, attempts, duration, reason FROM tests WHERE run = ?",
                (number,),
            ).fetchall()

    def measurements(self, number: int) -> list[MeasurementRow]:
        """The measurements of a run, in the order of test, subject, name and repetition."""
        with self._telling():
            return self._connection.execute(
                "SELECT test, subject, name, repetition, value, not_finite, unit, low, high, marginal, verdict "
                "FROM measurements WHERE run = ?",
                (number,),
            ).fetchall()

    @contextmanager
    def snapshot(self) -> Iterator[None]:
        """See one state of the file throughout the block, whatever others write meanwhile."""
        with self._telling():
            self._connection.execute("BEGIN")
        try:
            yield
        finally:
            self._connection.execute("ROLLBACK")

    # Opening and closing -----------------------------------------------------------------------------------------

    def close(self) -> None:
        """Be done with the file."""
        with self._telling():
            self._connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._connection.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._connection.execute("COMMIT")
        except BaseException:
            if self._connection.in_transaction:
                self._connection.execute("ROLLBACK")
            raise

    @contextmanager
    def _telling(self) -> Iterator[None]:
        """Say of what goes wrong with the file which one it is, and what fixes it."""
        try:
            yield
        except ForeignFileError as error:
            raise HistoryError(f"cannot use the history {self.path}: {error}") from None
        except sqlite3.Error as error:
            raise HistoryError(f"cannot use the history {self.path}: {error}; {_hint(error)}") from error
        except HistoryError:
            raise
        except OSError as error:
            raise HistoryError(f"cannot use the history {self.path}: {error.strerror}; {_ELSEWHERE}") from None


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
    """Open the file, for reading alone where it cannot be written, as on a stick or in an archive."""
    mode = "rwc" if create else "rw"
    if read_only:
        # What is still in the write-ahead log can be read only with files beside it that cannot be made there.
        mode = "ro" if path.with_name(f"{path.name}-wal").exists() else "ro&immutable=1"
    return sqlite3.connect(
        f"{path.absolute().as_uri()}?mode={mode}",
        uri=True,
        timeout=_PATIENCE,
        isolation_level=None,
        check_same_thread=False,
    )


def _write_ahead(connection: sqlite3.Connection) -> None:
    """Let readers and a writer not wait for each other. A file system without shared memory has to do without.

    SQLite does not wait here for others who are doing the same, so we do.
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
