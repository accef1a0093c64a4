"""The file of a log: an SQLite file with a greatest size, written by one collector and read by any number of readers.

The file keeps its size: when it is full, the oldest records make room (``docs/decisions/0045``). Readers and the writer
do not wait for each other (write-ahead log). ``application_id`` distinguishes our files from those of other programs.
"""

from __future__ import annotations

import os
import sqlite3
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from rtf.errors import RtfError
from rtf.logs.query import Query
from rtf.logs.record import Level, LogRecord

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from types import TracebackType

FILE_NAME = "logs.sqlite"
#: The usual greatest size of a file, in bytes: about a million records.
MAX_SIZE = 256 << 20
#: The least one: below it a batch of records would not fit.
LEAST_SIZE = 1 << 20

#: "RTFL" in the header of the file, and the version of its tables.
_APPLICATION, _VERSION = 0x5254464C, 1
#: Seconds to wait for another writer.
_PATIENCE = 10.0
#: When the file is full, this part of the records is removed.
_REMOVED_PART = 10
#: Pages of the write-ahead log, 16 MiB, after which they are copied into the file: seldom enough for a fast log.
_CHECKPOINT = 4000
#: Senders whose numbers are remembered.
_REMEMBERED = 4096
#: Numbers that one window looks through at most: some tenths of a second.
SCAN = 100_000
#: Records of one INSERT. SQLite releases Python's lock once a statement, and gets it back slowly while other threads
#: compute, so a statement is to do much.
_ROWS = (250, 25, 1)
_COLUMNS = ("arrived", "sender", "level", "time", "message", "component", "identity", "details", "backtrace")
_INSERTS = {
    rows: f"INSERT INTO records ({', '.join(_COLUMNS)}) VALUES "  # noqa: S608 - the names are constants
    + ", ".join([f"({', '.join('?' * len(_COLUMNS))})"] * rows)
    for rows in _ROWS
}
_TABLES = (
    "CREATE TABLE senders (number INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE)",  # the names of their ports
    """CREATE TABLE records (
        number INTEGER PRIMARY KEY,  -- in the order of arrival
        arrived REAL NOT NULL,       -- seconds since 1970 by the clock of the collector
        sender INTEGER NOT NULL,     -- a number of senders
        level INTEGER NOT NULL,      -- 0 unknown, 1 trace, 2 debug, 3 info, 4 warning, 5 error, 6 fatal
        time REAL NOT NULL,          -- seconds since 1970 by the clock of the sender
        message TEXT NOT NULL,
        component TEXT NOT NULL,
        identity TEXT NOT NULL,
        details TEXT NOT NULL,       -- the other groups of the record, as text
        backtrace TEXT NOT NULL
    )""",
    f"PRAGMA application_id = {_APPLICATION}",
    f"PRAGMA user_version = {_VERSION}",
)
_READ = (
    "SELECT records.number, arrived, name, level, time, message, component, identity, details, backtrace "
    "FROM records CROSS JOIN senders ON senders.number = records.sender WHERE "
)


class LogFileError(RtfError, OSError):
    """The file of a log cannot be read or written."""


def default_place() -> Path:
    """Return the file of the log when nobody names one: a file of the user's."""
    import platformdirs

    return Path(platformdirs.user_data_dir("rtf", appauthor=False)) / FILE_NAME


class _LogFile:
    """An open file. Every method raises LogFileError, which names the file and what to do."""

    def __init__(self, path: Path, mode: str) -> None:
        self.path = path
        with self._translate_errors():
            self._connection = sqlite3.connect(
                f"{path.absolute().as_uri()}?mode={mode}",
                uri=True,
                timeout=_PATIENCE,
                isolation_level=None,
                check_same_thread=False,
            )
        try:
            with self._translate_errors():
                self._prepare()
        except BaseException:
            self._connection.close()
            raise

    def _prepare(self) -> None:
        application, version, tables = self._state()
        if (application, version) != (_APPLICATION, _VERSION):
            if application == _APPLICATION and version > _VERSION:
                raise self._error(f"it is of version {version}, and this RTF knows {_VERSION}; use the newer RTF")
            what = "a database of something else" if application or version or tables else "empty"
            raise self._error(f"it is {what}; name another file with --file")

    def _state(self) -> tuple[int, int, int]:
        """Return the application, the version, and the number of tables and indexes."""
        found = self._connection.execute(
            "SELECT application_id, user_version, (SELECT count(*) FROM sqlite_master) "
            "FROM pragma_application_id, pragma_user_version"
        ).fetchone()
        return int(found[0]), int(found[1]), int(found[2])

    @contextmanager
    def _translate_errors(self) -> Iterator[None]:
        """Turn errors of SQLite into LogFileError, with the file and what to do."""
        try:
            yield
        except sqlite3.Error as error:
            raise self._error(f"{error}; {_hint(error)}") from error

    def _error(self, reason: str) -> LogFileError:
        return LogFileError(f"cannot use the log {self.path}: {reason}")

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


class LogStore(_LogFile):
    """The writing end. The file is created if there is none; it grows up to ``max_size`` bytes. One thread's at a time.

    What was added is in the file when :meth:`add` returns, also if the program dies; the last records may be lost when
    the computer does.
    """

    def __init__(self, path: Path, *, max_size: int = MAX_SIZE) -> None:
        if max_size < LEAST_SIZE:
            raise LogFileError(f"a log of {max_size} bytes is too small; the least is {LEAST_SIZE >> 20} MiB")
        self._numbers: dict[str, int] = {}
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise LogFileError(f"cannot make the folder of the log {path}: {error.strerror or error}") from None
        super().__init__(path, "rwc")
        with self._translate_errors():
            (page,) = self._connection.execute("PRAGMA page_size").fetchone()
        self._most_pages = max_size // int(page)

    def _prepare(self) -> None:
        connection = self._connection
        if self._state() == (0, 0, 0):
            connection.execute("PRAGMA journal_mode = WAL")
            with self._transaction():
                if self._state() == (0, 0, 0):  # another collector may have been faster
                    for statement in _TABLES:
                        connection.execute(statement)
        super()._prepare()
        connection.execute("PRAGMA synchronous = NORMAL")
        connection.execute(f"PRAGMA wal_autocheckpoint = {_CHECKPOINT}")

    def add(self, records: Sequence[tuple[float, LogRecord]]) -> None:
        """Add records, each with the time of its arrival, in one transaction. A full file loses its oldest."""
        with self._translate_errors():
            with self._transaction():
                try:
                    self._insert(records)
                except UnicodeEncodeError:  # bytes that are no UTF-8; few texts have them
                    self._connection.execute("ROLLBACK")
                    self._connection.execute("BEGIN IMMEDIATE")
                    self._numbers.clear()
                    self._insert([(arrived, _cleaned(record)) for arrived, record in records])
            self._make_room()

    def _insert(self, records: Sequence[tuple[float, LogRecord]]) -> None:
        execute = self._connection.execute
        numbers = self._numbers
        rows = [
            (arrived, numbers.get(record[0]) or self._number(record[0]), *record[1:]) for arrived, record in records
        ]
        done = 0
        for size in _ROWS:
            while len(rows) - done >= size:
                execute(_INSERTS[size], [*chain.from_iterable(rows[done : done + size])])
                done += size

    def _number(self, sender: str) -> int:
        execute = self._connection.execute
        execute("INSERT OR IGNORE INTO senders (name) VALUES (?)", (sender,))
        (number,) = execute("SELECT number FROM senders WHERE name = ?", (sender,)).fetchone()
        if len(self._numbers) >= _REMEMBERED:
            self._numbers.clear()
        self._numbers[sender] = number
        return int(number)

    def _make_room(self) -> None:
        """Remove the oldest records if the file is full. Their pages are used again, so the file keeps its size."""
        execute = self._connection.execute
        while self._used_pages() > self._most_pages:
            first, last = execute("SELECT min(number), max(number) FROM records").fetchone()
            if first is None or first == last:
                return
            with self._transaction():
                execute("DELETE FROM records WHERE number <= ?", (first + (last - first) // _REMOVED_PART,))
                execute("DELETE FROM senders WHERE number NOT IN (SELECT sender FROM records)")
            self._numbers.clear()

    def _used_pages(self) -> int:
        (pages,) = self._connection.execute("PRAGMA page_count").fetchone()
        (free,) = self._connection.execute("PRAGMA freelist_count").fetchone()
        return int(pages - free)

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._connection.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._connection.execute("COMMIT")
        except BaseException:
            self._numbers.clear()  # those that were given in it
            if self._connection.in_transaction:
                self._connection.execute("ROLLBACK")
            raise


class LogReader(_LogFile):
    """The reading end, while a collector writes or after it. One thread's at a time."""

    def __init__(self, path: Path) -> None:
        if not path.exists():
            raise LogFileError(f"there is no log {path}; 'rtf logger' writes one, --file names another one")
        # A folder that cannot be written has no room for the files that readers of a write-ahead log share.
        alone = not os.access(path.absolute().parent, os.W_OK) and not path.with_name(f"{path.name}-wal").exists()
        super().__init__(path, "ro&immutable=1" if alone else "ro")

    def read(self, query: Query | None = None, *, after: int = 0, last: int | None = None) -> Iterator[Stored]:
        """Return the records that are wanted with a number above ``after``, in the order of arrival.

        ``last`` limits them to the newest ones.
        """
        condition, values = (query or Query()).condition()
        sql = f"{_READ} records.number > ? AND {condition} ORDER BY records.number"
        with self._translate_errors():
            rows: Iterable[tuple[Any, ...]]
            if last is None:
                rows = self._connection.execute(sql, (after, *values))
            else:
                rows = reversed(self._connection.execute(f"{sql} DESC LIMIT ?", (after, *values, last)).fetchall())
            for number, arrived, sender, level, *rest in rows:
                yield number, arrived, LogRecord(sender, Level(level), *rest)

    def newest(self) -> int:
        """Return the number of the newest record, or 0."""
        return self.ends()[1]

    def ends(self) -> tuple[int, int]:
        """Return the numbers of the oldest and the newest record; 1 and 0 if there is none."""
        with self._translate_errors():
            oldest, newest = self._connection.execute(
                "SELECT (SELECT min(number) FROM records), (SELECT max(number) FROM records)"
            ).fetchone()
        return (1, 0) if newest is None else (int(oldest), int(newest))

    def window(self, query: Query, low: int, high: int, count: int, *, newest: bool) -> Window:
        """Return at most ``count`` wanted records with numbers above ``low``, up to ``high``, from one of the two ends.

        At most :data:`SCAN` numbers are looked through, so a call takes a limited time; the window says which.
        """
        if newest:
            low = max(low, high - SCAN)
        else:
            high = min(high, low + SCAN)
        condition, values = query.condition()
        sql = (
            f"{_READ} records.number > ? AND records.number <= ? AND {condition} "
            f"ORDER BY records.number {'DESC' if newest else 'ASC'} LIMIT ?"
        )
        with self._translate_errors():
            rows = self._connection.execute(sql, (low, high, *values, count)).fetchall()
        records = [(row[0], row[1], LogRecord(row[2], Level(row[3]), *row[4:])) for row in rows]
        if newest:
            records.reverse()
        if len(records) == count:
            low, high = (records[0][0] - 1, high) if newest else (low, records[-1][0])
        return Window(records, low, high)

    def record(self, number: int) -> Stored | None:
        """Return the record of a number, or None if there is none, or none any more."""
        found = self.window(Query(), number - 1, number, 1, newest=True).records
        return found[0] if found else None


#: The number of a record, the time of its arrival, and the record.
Stored = tuple[int, float, LogRecord]


class Window(NamedTuple):
    """A part of a log: all wanted records with numbers above ``low``, up to ``high``, in the order of arrival."""

    records: list[Stored]
    low: int
    high: int


def _cleaned(record: LogRecord) -> LogRecord:
    fields = [field.encode("utf-8", "replace").decode() if isinstance(field, str) else field for field in record]
    return LogRecord(*fields)  # type: ignore[arg-type]  # of the same types


_ELSEWHERE = "name a file that can be used with --file"
_HINTS = {
    "SQLITE_BUSY": "another program holds it; try again when that is done",
    "SQLITE_NOTADB": "it is no log; name another file with --file",
    "SQLITE_CORRUPT": "move it away, and the next collector makes a new one",
    "SQLITE_FULL": "make room on the disk, or take a smaller --max-size",
}


def _hint(error: sqlite3.Error) -> str:
    name: str = getattr(error, "sqlite_errorname", "")
    return next((hint for start, hint in _HINTS.items() if name.startswith(start)), _ELSEWHERE)
