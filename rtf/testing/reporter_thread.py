"""The thread that calls the reporters, and the limits of its calls.

Events wait in a queue, so the run does not wait for a reporter unless a thousand of them are waiting. A call that takes
longer than its limit is left behind, together with its thread: the reporter is named in an ``InternalError`` and hears
nothing more, and a new thread goes on with the others. Reports that are files are brought up to date while the run
goes on, at most once a second, and less often when that would use more processor time than :data:`SHARE`.
"""

from __future__ import annotations

import resource
import threading
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING

from rtf import clock
from rtf.testing.events import Event, SuiteStarted
from rtf.testing.results import RunResult

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.testing.reporting import Reporter

#: Seconds that a call may take, and ``close``, which may have to write the whole report; that any call may take when
#: the run was asked to stop; and when it is asked while it waits for its reports.
CALL_LIMIT, CLOSE_LIMIT, STOPPING_LIMIT, HURRIED_LIMIT = 10.0, 30.0, 3.0, 1.0
#: Seconds between two updates of a report, and the part of the time that those of one report may use a processor. The
#: first of all, which has an entry to make for each test, is not counted.
PAUSE, SHARE = 1.0, 0.003

_BACKLOG = 1000
#: Seconds in which events gather before the thread wakes up again: to wake it for each one would take the run the
#: processor for longer than the reporters need it.
_GATHER = 0.02
_LOOK = 0.05
_WATCH = 1.0


def _cpu_time() -> float:
    """Seconds of processor time that this thread has used."""
    used = resource.getrusage(resource.RUSAGE_THREAD)
    return used.ru_utime + used.ru_stime


@dataclass(frozen=True, slots=True, eq=False)
class _Call:
    """A call in progress."""

    reporter: Reporter
    what: str
    began: float
    limit: float


@dataclass(slots=True)
class _Report:
    """A report that is brought up to date while the run goes on: when at the earliest, and as of which event it is."""

    reporter: Reporter
    due: float = 0.0
    shown: int = -1


class ReporterThread:
    """Gives events to reporters, in order. ``broke`` is called with a reporter that broke or hangs, and with what.

    Reports are brought up to date when the first suite has started, if the run is ``live``.
    """

    def __init__(self, reporters: list[Reporter], broke: Callable[[Reporter, BaseException], None]) -> None:
        self.live = False
        self._reporters = reporters
        self._broke = broke
        self._results = RunResult()
        self._queue: SimpleQueue[Event | threading.Event | None] = SimpleQueue()
        self._event = Event()
        self._told = 0
        self._rest: list[Reporter] = []  # those that have yet to hear the event in hand
        self._reports: list[_Report] = []
        self._call_now: _Call | None = None
        self._most = clock.FOREVER  # no call may take longer, whatever its own limit
        self._lock = threading.Lock()
        self._closing = False
        self._awaited = threading.Event()  # somebody waits for the reporters
        self._done = threading.Event()
        self._thread: threading.Thread | None = None

    def put(self, event: Event) -> None:
        """Have the reporters hear of an event."""
        if self._thread is None:
            self._start()
        self._queue.put(event)

    def wait_for_room(self) -> None:
        """Wait while too many events are waiting. To be called without any lock that a reporter may need."""
        while self._queue.qsize() > _BACKLOG and self._reporters and threading.current_thread() is not self._thread:
            self._done.wait(_LOOK / 10)

    def flush(self, asked: Callable[[], int] = lambda: 0) -> None:
        """Wait until the reporters have heard of everything so far. ``asked`` counts the requests to stop."""
        if self._thread is not None and threading.current_thread() is not self._thread:
            passed = threading.Event()
            self._queue.put(passed)
            self._awaited.set()
            self._wait_for(passed, asked)

    def close(self, asked: Callable[[], int] = lambda: 0) -> None:
        """Let every reporter finish, the first one last: it can still tell of another one that breaks."""
        if self._done.is_set() or (self._thread is None and not self._reporters):
            return
        if self._thread is None:
            self._start()
        self._queue.put(None)
        self._awaited.set()
        self._wait_for(self._done, asked)

    def _wait_for(self, reached: threading.Event, asked: Callable[[], int]) -> None:
        before = asked()
        self._most = STOPPING_LIMIT if before else clock.FOREVER
        while not reached.wait(_LOOK) and not self._done.is_set():
            if asked() > before:
                self._most = HURRIED_LIMIT
            self._leave_what_hangs()
            if self._thread is not None and not self._thread.is_alive():  # it broke itself; nobody is to wait for it
                return

    def _start(self) -> None:
        if self._thread is None:
            threading.Thread(target=self._watch, name="rtf-reports-watch", daemon=True).start()
        self._thread = threading.Thread(target=self._work, name="rtf-reports", daemon=True)
        self._thread.start()

    def _watch(self) -> None:
        while not self._done.wait(_WATCH):
            self._leave_what_hangs()

    def _leave_what_hangs(self) -> None:
        with self._lock:
            call = self._call_now
            limit = min(call.limit, self._most) if call is not None else clock.FOREVER
            if call is None or clock.monotonic() - call.began < limit:
                return
            self._call_now = None
            self._leave_out(call.reporter)
            self._start()
        self._broke(call.reporter, TimeoutError(f"{call.what}() did not return within {limit:g} s"))

    # In the thread ---------------------------------------------------------------------------------------------------

    def _work(self) -> None:
        while not self._done.is_set():
            if self._rest:
                self._call(self._rest.pop(0), "handle", self._event, self._results)
            elif self._closing and self._queue.empty():
                self._close_next()
            else:
                self._next()

    def _next(self) -> None:
        wait = self._time_to_update()
        if wait is not None and wait <= 0:
            self._update()
            return
        if self._queue.empty():
            self._awaited.wait(_GATHER)
        try:
            item = self._queue.get(timeout=wait)
        except Empty:
            return
        if item is None:
            self._closing = True
        elif isinstance(item, threading.Event):
            self._awaited.clear()
            item.set()
        else:
            self._take(item)

    def _take(self, event: Event) -> None:
        self._results.apply(event)
        self._event = event
        self._told += 1
        self._rest = [*self._reporters]
        if self.live and isinstance(event, SuiteStarted) and not self._reports:
            self._reports = [_Report(reporter) for reporter in self._reporters]

    def _time_to_update(self) -> float | None:
        due = [report.due for report in self._reports if report.shown != self._told]
        return min(due) - clock.monotonic() if due and not self._closing else None

    def _update(self) -> None:
        for report in [*self._reports]:
            if report.due <= clock.monotonic() and report.shown != self._told:
                first, report.shown = report.shown < 0, self._told
                began = _cpu_time()
                self._call(report.reporter, "update", self._results)
                pause = PAUSE if first else max(PAUSE, (_cpu_time() - began) / SHARE)
                report.due = clock.monotonic() + pause

    def _close_next(self) -> None:
        if self._reporters:
            self._call(self._reporters.pop(), "close", self._results)
        else:
            self._done.set()

    def _call(self, reporter: Reporter, what: str, *arguments: object) -> None:
        limit = reporter.patience_of_close if what == "close" else reporter.patience
        call = self._call_now = _Call(reporter, what, clock.monotonic(), limit)
        problem: BaseException | None = None
        try:
            getattr(reporter, what)(*arguments)
        except BaseException as error:  # noqa: BLE001 - told of; SystemExit of a plug-in ends nothing here
            problem = error
        with self._lock:
            if self._call_now is not call:
                raise SystemExit  # left behind: another thread has gone on
            self._call_now = None
            if problem is not None:
                self._leave_out(reporter)
        if problem is not None:
            self._broke(reporter, problem)

    def _leave_out(self, reporter: Reporter) -> None:
        for members in (self._reporters, self._rest):
            if reporter in members:
                members.remove(reporter)
        self._reports = [report for report in self._reports if report.reporter is not reporter]
