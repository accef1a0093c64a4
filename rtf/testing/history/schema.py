"""The tables of the history, and how a file of an older version is brought up to this one.

The version stands in ``user_version``, and ``application_id`` tells our files from other people's. A step, once
released, is never changed; a new version is a new step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.testing.suite.ids import renewed

if TYPE_CHECKING:
    import sqlite3
    from collections.abc import Sequence

#: "RTFH" in the header of the file.
APPLICATION = 0x52544648

#: What leads from version 0, an empty file, to 1, and so on. Rows lie in the order of their keys, so that what belongs
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
)


class ForeignFileError(Exception):
    """The file is a database of something else, or of a newer RTF."""


def version_of(connection: sqlite3.Connection, newest: int) -> int:
    """The version of an open file; 0 when there is nothing in it. Raises ForeignFileError for what is not ours."""
    looks_alone = not connection.in_transaction
    if looks_alone:
        connection.execute("BEGIN")  # one look at all three: somebody else may be making the file right now
    try:
        (application,) = connection.execute("PRAGMA application_id").fetchone()
        (version,) = connection.execute("PRAGMA user_version").fetchone()
        (tables,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    finally:
        if looks_alone and connection.in_transaction:
            connection.execute("ROLLBACK")
    if application != APPLICATION and (application or version or tables):
        raise ForeignFileError("it is a database of something else; name another file")
    if version > newest:
        raise ForeignFileError(
            f"it is of version {version}, and this RTF knows {newest}; use the newer RTF that made it, or another file"
        )
    return int(version)


def migrate(connection: sqlite3.Connection, steps: Sequence[Sequence[str]]) -> None:
    """Bring the file up to the version of the last step. To be called in a transaction that may write."""
    done = version_of(connection, len(steps))
    connection.create_function("renewed_id", 3, renewed, deterministic=True)
    for step in steps[done:]:
        for statement in step:
            connection.execute(statement)
    connection.execute(f"PRAGMA application_id = {APPLICATION}")
    connection.execute(f"PRAGMA user_version = {len(steps)}")
