"""The recorder: one port to which all sources send, and a thread that writes what comes.

Nothing waits for the disk: what arrives is kept in memory, up to a limit, until it is written. Beyond the limit
messages are dropped, counted and reported. A source that went is connected again when it is back.
"""

from __future__ import annotations

import threading
from collections import Counter, deque
from typing import TYPE_CHECKING, NamedTuple, Self

from rtf import clock
from rtf.errors import RtfError
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.ports import remote
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.quiet import await_quiet
from rtf.middleware.wire.contact import Contact
from rtf.recording.dumper import DiskError
from rtf.recording.sample import sample_of

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType

    from rtf.bottle import Dialect
    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage
    from rtf.recording.sample import Store

#: Bytes that may wait to be written.
MEMORY = 512 << 20
#: What Python needs for a waiting message beside its data, in bytes.
_OVERHEAD = 500
#: Seconds between two batches, and between two looks for sources that went.
_PAUSE, _WATCH = 0.05, 1.0
#: Seconds that are waited at the end for what has been sent.
_CLOSING = 2.0


class _Waiting(NamedTuple):
    """A message that waits to be written, or the coming or going of a source."""

    time: float
    source: str
    message: IncomingMessage | None
    connected: bool = False


class Recorder:
    """A recorder with an open port. ``close`` ends its connections and writes what waits; the store stays open.

    ``name`` is that of its port, empty for any. ``failed`` is called in the writing thread when the store cannot be
    written any more; ``failure`` then says why. ``written``, ``dropped`` and ``refused`` count messages by source;
    refused are those that the format cannot hold, or that are no messages of YARP. ``skipped`` are those that are
    missing by the numbers of the stamps without having been dropped: senders skip a message while a reader, or the
    machine, is too slow for the one before.
    """

    def __init__(
        self,
        store: Store,
        *,
        name: str = "",
        network: Network | None = None,
        memory: int = MEMORY,
        failed: Callable[[], object] = lambda: None,
    ) -> None:
        self.written: Counter[str] = Counter()
        self.dropped: Counter[str] = Counter()
        self.refused: Counter[str] = Counter()
        self._missing: Counter[str] = Counter()
        self._counts: dict[str, int] = {}
        self.failure: RtfError | None = None
        self._store = store
        self._failed = failed
        self._memory = memory
        self._lock = threading.Lock()
        self._waiting: deque[_Waiting] = deque()
        self._size = 0
        self._arrived, self._closing, self._closed = threading.Event(), threading.Event(), threading.Event()
        self._sources: dict[str, str] = {}  # with their carriers
        self._connected: set[str] = set()
        self._dialects: dict[str, Dialect] = {}
        self._port = Port(name, self._receive, network=network, outputs=False, nonblocking=True)
        self._threads = [
            threading.Thread(target=work, name=f"rtf-record-{work.__name__.strip('_')}", daemon=True)
            for work in (self._write_all, self._watch)
        ]
        for thread in self._threads:
            thread.start()

    @property
    def skipped(self) -> Counter[str]:
        """How many messages of each source its sender has skipped. To be read at the end."""
        return self._missing - self.dropped - self.refused

    @property
    def port(self) -> Port:
        """The port to which the sources send."""
        return self._port

    def connect(self, source: Contact, carrier: str = "") -> None:
        """Have a port send to the recorder, now and whenever it is back. Raises MiddlewareError if it is not there."""
        chosen = source.carrier or carrier
        remote.connect(self._port.network, source, Contact(self._port.name), chosen)
        self._note(source.name, connected=True)
        self._sources[source.name] = chosen

    def close(self) -> None:
        """Receive nothing more, and write what has been sent. A second call has no effect."""
        await_quiet(self._port, clock.Deadline.after(_CLOSING))
        self._closing.set()
        self._port.close()
        self._closed.set()
        self._arrived.set()
        for thread in self._threads:
            thread.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # In the threads of the connections -------------------------------------------------------------------------------

    def _receive(self, message: IncomingMessage) -> None:
        """Keep a message, or drop it if there is no room."""
        size = (message.size or 0) + _OVERHEAD
        now = clock.now()
        with self._lock:
            if self._size + size > self._memory:
                self.dropped[message.sender] += 1
            else:
                self._size += size
                self._waiting.append(_Waiting(now, message.sender, message.kept()))
        if not self._arrived.is_set():
            self._arrived.set()

    # In the thread that looks after the connections ------------------------------------------------------------------

    def _watch(self) -> None:
        while not self._closing.wait(_WATCH):
            sources = [*self._sources.items()]  # before the inputs: one that is added now has its connection already
            there = {one.sender for one in self._port.inputs}
            for source, carrier in sources:
                if source in there:
                    continue
                if source in self._connected:
                    self._note(source, connected=False)
                    self._port.network.report(f"{source} has ended; it is recorded again when it is back")
                try:
                    remote.connect(self._port.network, Contact(source), Contact(self._port.name), carrier)
                except MiddlewareError:  # not there yet
                    continue
                self._note(source, connected=True)

    def _note(self, source: str, *, connected: bool) -> None:
        (self._connected.add if connected else self._connected.discard)(source)
        with self._lock:
            self._waiting.append(_Waiting(clock.now(), source, None, connected))

    # In the writing thread -------------------------------------------------------------------------------------------

    def _write_all(self) -> None:
        flush = clock.Deadline.after(self._store.period)
        while True:
            self._arrived.wait(self._store.period)
            last = self._closed.is_set()
            self._arrived.clear()
            with self._lock:
                batch, self._waiting = self._waiting, deque()
            try:
                self._write(batch)
                if last or flush.expired:
                    self._store.flush()
                    flush = clock.Deadline.after(self._store.period)
            except RtfError as error:
                self.failure = error
                self._failed()
                return
            if last:
                return
            self._closed.wait(_PAUSE)

    def _write(self, batch: deque[_Waiting]) -> None:
        while batch:
            waiting = batch.popleft()
            if waiting.message is None:
                self._store.note(waiting.time, waiting.source, connected=waiting.connected)
                continue
            self._write_message(waiting.message, waiting.time, waiting.source)
            with self._lock:
                self._size -= (waiting.message.size or 0) + _OVERHEAD

    def _write_message(self, message: IncomingMessage, time: float, source: str) -> None:
        message.dialect = self._dialects.get(source, message.dialect)
        try:
            sample = sample_of(message, time)
            self._store.add(sample)
        except DiskError:
            raise
        except RtfError as error:
            if not self.refused[source]:
                self._port.network.report(f"a message of {source} is not recorded: {error}")
            self.refused[source] += 1
            return
        self._dialects[source] = message.dialect
        self.written[source] += 1
        count, before = sample.stamp.count, self._counts.get(source, -1)
        if 0 <= before < count:
            self._missing[source] += count - before - 1
        self._counts[source] = count
