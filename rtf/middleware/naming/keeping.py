"""Has the names of open ports known by a name server that was restarted and forgot them.

A server tells nobody that it is back, so it is asked about one port every two seconds, in a thread that lives only
while there are ports. When that port is not known, or the server had not answered before, all are looked at, and
those that are missing are registered again as they were. So a name that somebody takes from the server while its port
is open comes back, too; but one that another program has registered since is left to it.
"""

from __future__ import annotations

import threading
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from rtf.middleware.errors import MiddlewareError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from rtf.middleware.names import Contact


@dataclass(slots=True)
class Record:
    """All that a server was told about a port."""

    contact: Contact
    promise: str = ""
    properties: dict[str, Sequence[str]] = field(default_factory=dict)
    announced: bool = False
    #: The server could not be told that it is announced.
    owed: bool = False


class Keeper:
    """Looks after the names of this process: ``find`` asks the server for one, ``restore`` tells it one again."""

    def __init__(self, find: Callable[[str], Contact | None], restore: Callable[[Record], None], period: float) -> None:
        self._find = find
        self._restore = restore
        self._period = period
        self._records: dict[str, Record] = {}
        self._changed = threading.Condition()
        # Held while one name is restored or unregistered, so that none comes back after it was given up.
        self._changing = threading.RLock()
        self._doubtful = False
        self._thread: threading.Thread | None = None

    def keep(self, record: Record) -> None:
        """A port has been registered."""
        with self._changed:
            self._records[record.contact.name] = record
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="rtf-names", daemon=True)
                self._thread.start()

    def note(self, name: str, key: str, values: Sequence[str]) -> None:
        """Something was noted about a port, perhaps one of ours."""
        with self._changed:
            if name in self._records:
                self._records[name].properties[key] = tuple(values)

    def announced(self, name: str, *, heard: bool) -> bool:
        """A port was announced, whether the server has heard it or not. False when it is none of ours."""
        with self._changed:
            record = self._records.get(name)
            if record is not None:
                record.announced, record.owed = True, not heard
            return record is not None

    def doubt(self) -> None:
        """The server did not answer: once it does again, all names are looked at."""
        self._doubtful = True

    @contextmanager
    def forgetting(self, name: str) -> Iterator[None]:
        """Around unregistering a port and, as the server does, what it owns; the thread ends with the last one."""
        with self._changing:
            with self._changed:
                pending = [name]
                while pending:
                    record = self._records.pop(pending.pop(), None)
                    pending += record.properties.get("owns", ()) if record else ()
                if not self._records:
                    self._changed.notify_all()
            yield

    def close(self) -> None:
        """Look after nothing any more."""
        with self._changing, self._changed:
            self._records.clear()
            thread = self._thread
            self._changed.notify_all()
        if thread is not None and thread is not threading.current_thread():
            thread.join()

    def _run(self) -> None:
        turn = 0
        while True:
            with self._changed:
                self._changed.wait_for(lambda: not self._records, self._period)
                if not self._records:
                    self._thread = None
                    return
                names = [*self._records]
                turn = (turn + 1) % len(names)
                record = self._records[names[turn]]
            try:
                if self._doubtful or self._missing(record):
                    self._doubtful = False
                    self._look_at(names)
            except MiddlewareError:
                self._doubtful = True  # it is away: the same again after the next period

    def _look_at(self, names: Sequence[str]) -> None:
        for name in names:
            with self._changing:
                record = self._records.get(name)
                if record is not None and self._missing(record):
                    self._restore(record)
                    record.owed = False

    def _missing(self, record: Record) -> bool:
        """Whether the server does not know one of our ports, or not all of it."""
        contact = record.contact
        found = self._find(contact.name)
        with self._changed:
            ours = self._records.get(contact.name) is record
            if found is None or record.owed:
                return ours
            if ours and (found.host, found.port) != (contact.host, contact.port):
                del self._records[contact.name]
        return False
