"""The thread that calls reporters, and the limits of its calls.

Events and awaited calls are in a queue, so the run does not wait for a reporter unless a thousand events are waiting. A
call that takes longer than its limit is abandoned, together with its thread: its reporter is called no more, and a new
thread goes on with the others. Reports that are files are updated while the run goes on: when the first suite starts,
when the first test ends, then at most once a second, and less often when that would take more of the time than
:data:`SHARE`.
"""

from __future__ import annotations

import resource
import threading
from collections import deque
from dataclasses import dataclass
from functools import partial
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any

from rtf import clock
from rtf.testing.events import Event, SuiteStarted, TestEnded
from rtf.testing.reporting import CALL_LIMIT
from rtf.testing.results import RunResult

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from rtf.testing.reporting import Reporter

#: Seconds that any call may take when the run was asked to stop, and when it is asked while it waits for its reports.
STOPPING_LIMIT, HURRIED_LIMIT = 3.0, 1.0
#: Seconds between two updates of a report, and the part of the time that those of one report may take. The first of
#: all, which may have to import what it needs, is not counted.
PAUSE, SHARE = 1.0, 0.003
#: On a busy machine an update takes longer, like the run, but not so many times longer than it uses a processor: then
#: it was merely interrupted.
_BUSIEST = 10

_BACKLOG = 1000
#: Seconds in which events gather before the thread wakes up again: to wake it for each one would take the run the
#: processor for longer than the reporters need it.
_GATHER = 0.02
_LOOK = 0.05
_WATCH = 1.0


@dataclass(slots=True, eq=False)
class _Member:
    """A reporter: whether it is called no more, when its report may be updated, and up to which event it is written."""

    reporter: Reporter
    left_out: bool = False
    due: float = 0.0
    shown: int = -1


@dataclass(slots=True, eq=False)
class Call:
    """A call of a reporter, or of none. ``done`` is set when it is over or abandoned, if a thread waits for it."""

    member: _Member | None
    what: str
    function: Callable[[], Any]
    limit: float = CALL_LIMIT
    began: float = 0.0
    answer: Any = None
    error: BaseException | None = None
    done: threading.Event | None = None


class ReporterThread:
    """Calls reporters, one after the other. ``broke`` is called with a reporter that broke or hangs, and the error.

    Reports are updated when the first suite has started, if the run is ``live``.
    """

    def __init__(self, reporters: Iterable[Reporter], broke: Callable[[Reporter, BaseException], None]) -> None:
        self.live = False
        self._members = [_Member(reporter) for reporter in reporters]
        self._broke = broke
        self._results = RunResult()
        self._queue: SimpleQueue[Event | Call | None] = SimpleQueue()
        self._calls: deque[Call] = deque()  # for what was taken from the queue last
        self._heard = 0
        self._updating = False
        self._none_ended = True
        self._call: Call | None = None  # in progress
        self._most = clock.FOREVER  # no call may take longer, whatever its own limit
        self._lock = threading.Lock()  # taken to end a call: by the thread that made it, or by one that abandons it
        self._awaited = threading.Event()  # a thread waits for the reporters
        self._over = threading.Event()
        self._thread: threading.Thread | None = None

    def put(self, item: Event | Call | None) -> None:
        """Queue an event or a call for the reporters; None ends the thread."""
        if self._thread is None:
            threading.Thread(target=self._watch, name="rtf-reports-watch", daemon=True).start()
            self._start()
        self._queue.put(item)

    def wait_for_room(self) -> None:
        """Wait while too many events are waiting. To be called without any lock that a reporter may need."""
        while self._queue.qsize() > _BACKLOG and threading.current_thread() is not self._thread:
            self._over.wait(_LOOK / 10)

    def wait_for(self, call: Call, most: Callable[[], float] = lambda: clock.FOREVER) -> None:
        """Make a call, and wait until it is over. ``most`` limits the time of any call, if it is less than usual."""
        done = call.done = threading.Event()
        self._most = clock.FOREVER
        self.put(call)
        self._awaited.set()
        while not done.wait(_LOOK) and self._thread is not None and self._thread.is_alive():
            if most() < self._most:
                with self._lock:
                    self._most = most()
                    if self._call is not None:  # it may take so much from now on
                        self._call.began = clock.monotonic()
            self._leave_what_hangs()

    def flush(self, asked: Callable[[], int]) -> None:
        """Wait until the reporters have all events so far. ``asked`` counts the requests to stop."""
        if self._thread is not None:
            self.wait_for(Call(None, "flush", lambda: None), _most_when(asked))

    def close(self, asked: Callable[[], int]) -> None:
        """Close every reporter, the first one last, so that it can still report another one that breaks."""
        most = _most_when(asked)
        self.flush(asked)
        self._updating = False
        for member in reversed(self._members):
            if not member.left_out:
                reporter = member.reporter
                call = Call(member, "close", partial(reporter.close, self._results), reporter.patience_of_close)
                self.wait_for(call, most)
                member.left_out = True
                if call.error is not None:
                    self._broke(reporter, call.error)
        self.put(None)

    def _start(self) -> None:
        thread = threading.Thread(target=self._work, name="rtf-reports", daemon=True)
        thread.start()
        self._thread = thread  # when it lives: the one that waits for the reporters looks at that

    def _watch(self) -> None:
        while not self._over.wait(_WATCH):
            self._leave_what_hangs()

    def _leave_what_hangs(self) -> None:
        with self._lock:
            call = self._call
            limit = min(call.limit, self._most) if call is not None else clock.FOREVER
            if call is None or clock.monotonic() - call.began < limit:
                return
            self._call = None
            if call.member is not None:
                call.member.left_out = True
            self._start()
        call.error = TimeoutError(f"{call.what}() did not return within {limit:g} s")
        self._finish(call)

    def _finish(self, call: Call) -> None:
        if call.error is not None and call.member is not None:
            call.member.left_out = True
            if call.done is None:
                self._broke(call.member.reporter, call.error)
        if call.done is not None:
            call.done.set()

    # In the thread ---------------------------------------------------------------------------------------------------

    def _work(self) -> None:
        while not self._over.is_set():
            if self._calls:
                self._make(self._calls.popleft())
            else:
                self._take_next()

    def _make(self, call: Call) -> None:
        answer: object = None
        problem: BaseException | None = None
        if call.member is None or not call.member.left_out:
            call.began, self._call = clock.monotonic(), call
            try:
                answer = call.function()
            except BaseException as error:  # noqa: BLE001 - reported; SystemExit of a plug-in ends nothing here
                problem = error
            with self._lock:
                if self._call is not call:
                    raise SystemExit  # abandoned: another thread has gone on
                self._call = None
        call.answer, call.error = answer, problem
        self._finish(call)

    def _take_next(self) -> None:
        """Wait for an event, a call or an update that is due, and queue the calls that it needs."""
        wait = self._look_for_updates()
        if self._calls:
            return
        if self._queue.empty():
            self._awaited.wait(_GATHER)
        try:
            item = self._queue.get(timeout=wait)
        except Empty:
            return
        if item is None:
            self._over.set()
        elif isinstance(item, Call):
            self._awaited.clear()
            self._calls.append(item)
        else:
            self._results.apply(item)
            self._heard += 1
            self._updating |= self.live and isinstance(item, SuiteStarted)
            if self._none_ended and isinstance(item, TestEnded):
                self._none_ended = False
                for member in self._members:
                    member.due = 0.0
            for member in self._members:
                if not member.left_out:
                    function = partial(member.reporter.handle, item, self._results)
                    self._calls.append(Call(member, "handle", function, member.reporter.patience))

    def _look_for_updates(self) -> float | None:
        """Find the updates that are due; returns the seconds until the next one, or None when there is none to come."""
        if not self._updating:
            return None
        now = clock.monotonic()
        old = [member for member in self._members if member.shown < self._heard and not member.left_out]
        for member in old:
            if member.due <= now:
                self._calls.append(Call(member, "update", partial(self._update, member), member.reporter.patience))
        return min((member.due - now for member in old), default=None)

    def _update(self, member: _Member) -> None:
        first, member.shown = member.shown < 0, self._heard
        began, used_before = clock.monotonic(), _cpu_time()
        member.reporter.update(self._results)
        now, used = clock.monotonic(), _cpu_time() - used_before
        member.due = now + (PAUSE if first else max(PAUSE, min(now - began, _BUSIEST * used) / SHARE))


def _cpu_time() -> float:
    """Seconds of processor time that this thread has used."""
    used = resource.getrusage(resource.RUSAGE_THREAD)
    return used.ru_utime + used.ru_stime


def _most_when(asked: Callable[[], int]) -> Callable[[], float]:
    """Return a function for the longest time of a call while a run waits for its reporters, by its requests to stop."""
    before = asked()
    return lambda: HURRIED_LIMIT if asked() > before else STOPPING_LIMIT if before else clock.FOREVER


def bounded(reporter: Reporter, what: str) -> Any:
    """Call a reporter outside of a run, and return its answer. Raises TimeoutError when it takes too long."""
    return _alone(Call(None, what, getattr(reporter, what), reporter.patience))


def let_linger(reporters: Iterable[Reporter], stop: threading.Event) -> list[tuple[Reporter, Exception]]:
    """Let each reporter show the finished run as long as it stays. Returns those that broke or hang, with the error."""
    problems: list[tuple[Reporter, Exception]] = []
    for reporter in reporters:
        limit = clock.FOREVER if reporter.stays else reporter.patience_of_close
        try:
            call = Call(None, "linger", partial(reporter.linger, stop), limit)
            _alone(call, lambda: STOPPING_LIMIT if stop.is_set() else clock.FOREVER)
        except Exception as error:  # noqa: BLE001 - given back, and the others have their turn
            problems.append((reporter, error))
    return problems


def _alone(call: Call, most: Callable[[], float] = lambda: clock.FOREVER) -> Any:
    thread = ReporterThread([], lambda _reporter, _error: None)
    try:
        thread.wait_for(call, most)
    finally:
        thread.put(None)
    if call.error is not None:
        raise call.error
    return call.answer
