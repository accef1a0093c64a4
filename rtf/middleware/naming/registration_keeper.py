"""Re-registration of open ports with a name server that was restarted without its data.

A server does not announce that it is back, so it is queried for one port every two seconds, in a thread that runs only
while there are ports. If that port is unknown, or the server had not answered before, all ports are checked, and the
missing ones are registered again as they were. A name that is removed from the server while its port is open therefore
comes back, too; but a name that another program has registered since is left to that program.
"""

from __future__ import annotations

import threading
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from rtf.middleware.errors import MiddlewareError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from rtf.middleware.wire.contact import Contact


@dataclass(slots=True)
class Record:
    """Everything that the server knows about a port."""

    contact: Contact
    promise: str = ""
    properties: dict[str, Sequence[str]] = field(default_factory=dict)
    announced: bool = False
    #: The port is announced, but the server has not received it.
    announcement_missing: bool = False


class RegistrationKeeper:
    """Keeps the names of this process registered: ``find`` queries the server, ``restore`` registers a port again."""

    def __init__(self, find: Callable[[str], Contact | None], restore: Callable[[Record], None], period: float) -> None:
        self._find = find
        self._restore = restore
        self._period = period
        self._records: dict[str, Record] = {}
        self._changed = threading.Condition()
        # Held while a name is restored or unregistered, so that no unregistered name is restored.
        self._changing = threading.RLock()
        self._needs_check = False
        self._closed = False
        self._thread: threading.Thread | None = None

    def keep(self, record: Record) -> None:
        """Start keeping a registered port."""
        with self._changed:
            if self._closed:
                return
            self._records[record.contact.name] = record
            if self._thread is None:
                thread = threading.Thread(target=self._run, name="rtf-names", daemon=True)
                thread.start()
                self._thread = thread

    def note(self, name: str, key: str, values: Sequence[str]) -> None:
        """Record a property that was set for a port. Ignored for ports of other processes."""
        with self._changed:
            if name in self._records:
                self._records[name].properties[key] = tuple(values)

    def announced(self, name: str, *, heard: bool) -> bool:
        """Record an announcement; ``heard``: the server has received it. Return False for a port of another process."""
        with self._changed:
            record = self._records.get(name)
            if record is not None:
                record.announced, record.announcement_missing = True, not heard
            return record is not None

    def mark_unanswered(self) -> None:
        """Record that the server did not answer. When it answers again, all names are checked."""
        self._needs_check = True

    @contextmanager
    def forgetting(self, name: str) -> Iterator[None]:
        """Stop keeping a port and the ports that it owns, for the duration of their unregistration.

        The thread ends with the last port.
        """
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
        """Stop keeping all ports."""
        with self._changing, self._changed:
            self._closed = True
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
                if self._needs_check or self._missing(record):
                    self._needs_check = False
                    self._look_at(names)
            except MiddlewareError:
                self._needs_check = True  # the server is down: check again after the next period

    def _look_at(self, names: Sequence[str]) -> None:
        for name in names:
            with self._changing:
                record = self._records.get(name)
                if record is not None and self._missing(record):
                    record.announcement_missing = False  # first: an announcement may fail meanwhile
                    try:
                        self._restore(record)
                    except MiddlewareError:
                        record.announcement_missing = record.announced
                        raise

    def _missing(self, record: Record) -> bool:
        """Return whether the server does not know one of our ports, or lacks its announcement."""
        contact = record.contact
        found = self._find(contact.name)
        with self._changed:
            ours = self._records.get(contact.name) is record
            if found is None or record.announcement_missing:
                return ours
            if ours and (found.host, found.port) != (contact.host, contact.port):
                del self._records[contact.name]
        return False
