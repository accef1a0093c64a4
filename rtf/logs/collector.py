"""The collector: the port ``/yarplogger``, whose records go into a file.

One thread reads all connections and only keeps the bytes; another one makes records of them and writes batches. What
waits in between is limited, and each sender has an equal share of that. A program that logs faster than can be written
loses records when its share is full, the others lose none, and the log has a warning of the program's with the number.
Nothing ever waits for the collector: a robot's program with a logger that is too slow would fill its own memory.
"""

from __future__ import annotations

import threading
from collections import deque
from typing import TYPE_CHECKING, Self

from rtf import clock
from rtf.logs.record import COLLECTOR, COMPONENT, Level, LogRecord, from_bytes
from rtf.logs.store import LogFileError
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.ports import remote
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.quiet import await_quiet
from rtf.middleware.types.codecs import RAW
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType

    from rtf.errors import RtfError
    from rtf.logs.store import LogStore
    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage

#: Bytes that may wait to be written: some 200 000 records.
MEMORY = 64 << 20
#: What Python needs for a waiting message beside its text, in bytes.
_OVERHEAD = 180
#: Records of one sender in a batch. The others wait for no more than these.
_TURN = 1000
#: Seconds between two batches: many records, one transaction.
_PAUSE = 0.02
#: Seconds that are waited at the end for what was sent, and between two looks.
_CLOSING, _LOOK = 2.0, 0.005
#: Seconds between two warnings about lost records of one sender.
_WARNING_INTERVAL = 1.0


class _Backlog:
    """What waits of one sender: messages with their arrivals, their size, and the number dropped since a warning."""

    __slots__ = ("dropped", "entries", "last_warning", "size")

    def __init__(self) -> None:
        self.entries: deque[tuple[float, bytes]] = deque()
        self.size = 0
        self.dropped = 0
        self.last_warning = 0.0


class Collector:
    """An open collector. It closes its port, then writes what waits; the store stays open.

    ``memory`` is the limit of what waits, in bytes. ``failed`` is called, in the writing thread, when the file cannot
    be written any more; ``failure`` then says why, and whatever arrives is dropped.
    """

    def __init__(
        self,
        store: LogStore,
        *,
        name: str = COLLECTOR,
        network: Network | None = None,
        memory: int = MEMORY,
        failed: Callable[[], object] = lambda: None,
    ) -> None:
        self.written = 0
        self.dropped = 0
        self.failure: RtfError | None = None
        self._store = store
        self._failed = failed
        self._memory = self._share = memory
        self._lock = threading.Lock()
        self._backlogs: dict[str, _Backlog] = {}
        self._writing = False
        self._arrived = threading.Event()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="rtf-log-writer", daemon=True)
        self._port = Port(name, self._receive, network=network, outputs=False, nonblocking=True)
        self._thread.start()

    @property
    def port(self) -> Port:
        """The port, ``/yarplogger``."""
        return self._port

    def connect_running(self) -> None:
        """Have the programs that forward already send to this collector; their ports begin with ``/log/``.

        One that does not answer is reported by the network. Raises MiddlewareError if there is no name server.
        """
        network, own = self._port.network, Contact(self._port.name)
        for contact in network.names.list("/log"):
            try:
                remote.connect(network, contact.by(""), own, "fast_tcp")
            except MiddlewareError as error:
                network.report(f"{contact.name} does not send to {own.name}: {error}")

    def flush(self, timeout: float = _CLOSING) -> bool:
        """Wait until what has been sent is in the file; return False after ``timeout`` seconds."""
        deadline = clock.Deadline.after(timeout)
        await_quiet(self._port, deadline)
        while self._backlogs or self._writing:
            if deadline.expired:
                return False
            clock.sleep(_LOOK)
        return True

    def close(self) -> None:
        """Write what has been sent, within two seconds, and receive nothing more. A second call has no effect."""
        await_quiet(self._port, clock.Deadline.after(_CLOSING))
        self._port.close()
        self._closing.set()
        self._arrived.set()
        self._thread.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # In the threads of the connections -------------------------------------------------------------------------------

    def _receive(self, message: IncomingMessage) -> None:
        """Keep a message, or drop it if the share of its sender is full."""
        data = message.read(RAW)
        size = len(data) + _OVERHEAD
        arrived = clock.now()
        with self._lock:
            backlog = self._backlogs.get(message.sender)
            if backlog is None:
                backlog = self._backlogs[message.sender] = _Backlog()
                self._share = self._memory // len(self._backlogs)
            if backlog.size + size > self._share:
                backlog.dropped += 1
            else:
                backlog.entries.append((arrived, data))
                backlog.size += size
        if not self._arrived.is_set():
            self._arrived.set()

    # In the writing thread -------------------------------------------------------------------------------------------

    def _run(self) -> None:
        while True:
            self._arrived.wait()
            closing = self._closing.is_set()
            if not closing:
                self._arrived.clear()
            self._writing = True
            batch = self._next_batch(hurry=closing)
            if batch:
                self._write(batch)
            self._writing = False
            if closing and not batch:
                return
            if self._backlogs:  # more waits, or a warning is due
                self._arrived.set()
            if len(batch) < _TURN:
                self._closing.wait(_PAUSE)

    def _next_batch(self, *, hurry: bool) -> list[tuple[float, LogRecord]]:
        """Return the oldest records of each sender, in the order of arrival."""
        now = clock.now()
        taken: list[tuple[float, str, bytes]] = []
        warnings: list[tuple[float, LogRecord]] = []
        with self._lock:
            for sender, backlog in [*self._backlogs.items()]:
                entries = backlog.entries
                for _ in range(min(_TURN, len(entries))):
                    arrived, data = entries.popleft()
                    backlog.size -= len(data) + _OVERHEAD
                    taken.append((arrived, sender, data))
                if backlog.dropped and (hurry or now - backlog.last_warning >= _WARNING_INTERVAL):
                    warnings.append((now, _warning(sender, backlog.dropped, now)))
                    self.dropped += backlog.dropped
                    backlog.dropped, backlog.last_warning = 0, now
                if not entries and not backlog.dropped:
                    del self._backlogs[sender]
            self._share = self._memory // max(1, len(self._backlogs))
        taken.sort()
        return [(arrived, from_bytes(data, sender, arrived)) for arrived, sender, data in taken] + warnings

    def _write(self, batch: list[tuple[float, LogRecord]]) -> None:
        if self.failure is not None:
            return
        try:
            self._store.add(batch)
            self.written += len(batch)
        except LogFileError as error:
            self.failure = error
            self._failed()


def _warning(sender: str, count: int, now: float) -> LogRecord:
    text = f"{count} records of this program were dropped: it logs faster than they can be written"
    return LogRecord(sender, Level.WARNING, now, text, COMPONENT)
