"""Where a name server keeps what it knows beyond its own life: nowhere, or in an SQLite file.

SQLite, and not a file that is written anew: a registration changes one row among thousands, and what was answered
before the server was killed is there when it comes back.
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
    """Values by kind and key. It is called by one thread at a time."""

    @abstractmethod
    def load(self, kind: str) -> Iterator[tuple[str, Any]]:
        """Everything of a kind. Any: the values are whatever JSON holds."""

    @abstractmethod
    def put(self, kind: str, key: str, value: object) -> None:
        """Keep a value."""

    @abstractmethod
    def drop(self, kind: str, key: str) -> None:
        """Forget one, whether it is there or not."""

    @abstractmethod
    def close(self) -> None:
        """Nothing follows."""


class Memory(Store):
    """Keeps nothing: what a server knows ends with it."""

    def load(self, kind: str) -> Iterator[tuple[str, Any]]:  # noqa: ARG002
        return iter(())

    def put(self, kind: str, key: str, value: object) -> None:
        """See Store."""

    def drop(self, kind: str, key: str) -> None:
        """See Store."""

    def close(self) -> None:
        """See Store."""


class Database(Store):
    """Keeps everything in a file, which belongs to one server at a time. Raises MiddlewareError when it cannot."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = path
        try:
            self._connection = sqlite3.connect(path, timeout=0.1, isolation_level=None, check_same_thread=False)
        except sqlite3.Error as error:
            raise self._error(error) from None
        try:
            # Killing the server must lose nothing, a power cut may lose the last second.
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
            f"the names in {self.path} cannot be kept: {error};"
            " if no other name server uses the file, move it out of the way"
        )
