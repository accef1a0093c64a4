"""The storage of a name server: none, or an SQLite file.

SQLite instead of a file that is rewritten: a registration changes one row among thousands, and after a kill of the
server all acknowledged changes are still there.
"""

from __future__ import annotations

import json
import sqlite3
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

from rtf.middleware.errors import MiddlewareError

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator

_SCHEMA = "CREATE TABLE IF NOT EXISTS names (kind TEXT, key TEXT, value TEXT, PRIMARY KEY (kind, key)) WITHOUT ROWID"


class Store(ABC):
    """Storage of values by kind and key. Used by one thread at a time."""

    @abstractmethod
    def load(self, kind: str) -> Iterator[tuple[str, Any]]:
        """Return all values of a kind by key. Any: the values have the types of JSON."""

    @abstractmethod
    def put(self, kind: str, key: str, value: object) -> None:
        """Store a value."""

    @abstractmethod
    def drop(self, kind: str, key: str) -> None:
        """Remove a value, if it is there."""

    @abstractmethod
    def close(self) -> None:
        """Close the storage."""


class Memory(Store):
    """A store without storage: the names end with the server."""

    def load(self, kind: str) -> Iterator[tuple[str, Any]]:  # noqa: ARG002
        return iter(())

    def put(self, kind: str, key: str, value: object) -> None:
        """Do nothing: nothing is stored."""

    def drop(self, kind: str, key: str) -> None:
        """Do nothing: nothing is stored."""

    def close(self) -> None:
        """Do nothing: there are no resources."""


class Database(Store):
    """A store in an SQLite file, which one server uses at a time. Raises MiddlewareError if it cannot."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = path
        try:
            self._connection = sqlite3.connect(path, timeout=0.1, isolation_level=None, check_same_thread=False)
        except sqlite3.Error as error:
            raise self._error(error) from None
        try:
            # A kill of the server must lose nothing; a power cut may lose the last second.
            for pragma in ("locking_mode=EXCLUSIVE", "journal_mode=WAL", "synchronous=NORMAL"):
                self._connection.execute(f"PRAGMA {pragma}")
            self._connection.execute(_SCHEMA)
        except sqlite3.Error as error:
            self._connection.close()
            raise self._error(error) from None

    def load(self, kind: str) -> Iterator[tuple[str, Any]]:
        try:
            rows = self._connection.execute("SELECT key, value FROM names WHERE kind = ?", (kind,)).fetchall()
            yield from ((key, json.loads(value)) for key, value in rows)
        except (sqlite3.Error, ValueError) as error:
            raise self._error(error) from None

    def put(self, kind: str, key: str, value: object) -> None:
        self._change("REPLACE INTO names VALUES (?, ?, ?)", kind, key, json.dumps(value))

    def drop(self, kind: str, key: str) -> None:
        self._change("DELETE FROM names WHERE kind = ? AND key = ?", kind, key)

    def close(self) -> None:
        self._connection.close()

    def _change(self, statement: str, *values: str) -> None:
        try:
            self._connection.execute(statement, values)
        except sqlite3.Error as error:
            raise self._error(error) from None

    def _error(self, error: Exception) -> MiddlewareError:
        return MiddlewareError(
            f"the names in {self.path} cannot be stored: {error};"
            " if no other name server uses the file, move it out of the way"
        )
