"""The one order in which the journal and all reporters get the events of a run."""

from __future__ import annotations

import errno
import threading
import traceback
from typing import TYPE_CHECKING

from rtf.testing import journal
from rtf.testing.events import Event, InternalError
from rtf.testing.journal import Journal, JournalError
from rtf.testing.reporter_thread import ReporterThread
from rtf.testing.results import RunResult

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable
    from pathlib import Path

    from rtf.testing.reporting import Reporter
    from rtf.testing.run_control import Control

#: What is full, and the hint, by the number of the operating system's error.
_NO_ROOM = {
    errno.ENOSPC: "free some space, then write the reports with: testrunner report",
    errno.EDQUOT: "free some space, then write the reports with: testrunner report",
    errno.EFBIG: "allow larger files (ulimit -f), then write the reports with: testrunner report",
    errno.EMFILE: "allow more open files (ulimit -n), then write the reports with: testrunner report",
    errno.ENFILE: "close other programs' files, then write the reports with: testrunner report",
}


def _reason(error: BaseException) -> str:
    return (error.strerror or str(error)) if isinstance(error, OSError) else f"{type(error).__name__}: {error}"


def _broken_journal(error: JournalError) -> InternalError:
    hint = _NO_ROOM.get(error.errno or 0, "")
    lost = "what follows is neither in the journal nor sure to be in the reports"
    return InternalError(text=f"{error}; {lost}{f'; {hint}' if hint else ''}")


class Broadcast:
    """Gives every event its place in the order, writes it down, and passes it to the reporters. Thread-safe.

    ``listener`` is called at once, in the thread that emits; reporters are called from a thread of their own.
    """

    def __init__(self, to: Journal | None, reporters: list[Reporter], *, listener: Reporter | None = None) -> None:
        self.results = RunResult()
        self.control: Control | None = None
        self.broken: list[Reporter] = []
        self._journal = to
        self._listener = listener
        self._thread = ReporterThread(reporters, self._drop)
        self._lock = threading.RLock()
        self._seq = 0
        self._no_room: set[int | None] = set()
        self._no_room_problem: InternalError | None = None

    def replay(self, events: Iterable[Event]) -> None:
        """Pass on events that are in the journal already, and go on counting after them."""
        for event in events:
            self._thread.wait_for_room()
            with self._lock:
                self._seq = max(self._seq, event.seq)
                self._pass_on(event)

    def resume(self, path: Path, void: Collection[str] = ()) -> None:
        """Pass on the earlier events of a run that is resumed, and go on counting where its journal stops.

        The suites and tests in ``void`` are no part of the run any more.
        """
        self.replay(journal.as_one_run(path, resuming=True, void=void))
        self._seq = max((event.seq for event in journal.read(path)), default=0)

    def emit(self, event: Event) -> None:
        """Take one event. It is written down first, so that the journal has whatever a report shows."""
        self._thread.wait_for_room()
        with self._lock:
            self._thread.live = True
            self._seq += 1
            event = event.with_seq(self._seq)
            problem = self._write(event)
            if problem is not None and event is self._no_room_problem:  # it is in the journal already
                event, problem = problem.with_seq(self._seq), None
            self._pass_on(event)
        if problem is not None:
            self.emit(problem)

    def flush(self, asked: Callable[[], int] = lambda: 0) -> None:
        """Wait until the reporters have all events. ``asked`` counts how often the run was asked to stop."""
        self._thread.flush(asked)

    def close_reporters(self, asked: Callable[[], int] = lambda: 0) -> None:
        """Close every reporter, once; a call that takes longer than its limit is abandoned."""
        self._thread.close(asked)

    def close(self) -> None:
        """Close every reporter and the journal."""
        self.close_reporters()
        with self._lock:
            written, self._journal = self._journal, None
            if written is not None:
                try:
                    written.close()
                except JournalError as error:
                    self.emit(_broken_journal(error))

    def _pass_on(self, event: Event) -> None:
        self.results.apply(event)
        if self.control is not None:
            self.control.note(event)
        if self._listener is not None:
            self._listener.handle(event, self.results)
        self._thread.put(event)

    def _write(self, event: Event) -> InternalError | None:
        if self._journal is None:
            return None
        try:
            self._journal.append(event)
        except JournalError as error:
            # The run goes on for the reporters' sake; the exit code and the console show the problem.
            self._journal.close_quietly()
            self._journal = None
            self._no_room.add(error.errno)
            return _broken_journal(error)
        return None

    def _drop(self, reporter: Reporter, error: BaseException) -> None:
        """Report once why a report is not written. One full disk is not reported again for each file on it."""
        name = type(reporter).plugin_name or type(reporter).__name__
        self.broken.append(reporter)
        if reporter.options.target is not None:
            reporter.options.unwritten[reporter.options.target] = _reason(error)
        number = error.errno if isinstance(error, OSError) else None
        if number is not None and number in self._no_room:
            return
        text = f"reporter {name} broke and is left out: {type(error).__name__}: {error}"
        if isinstance(error, OSError) and number in _NO_ROOM:
            self._no_room.add(number)
            self._no_room_problem = InternalError(text=f"{text}; {_NO_ROOM[number]}")
            self.emit(self._no_room_problem)
            return
        bounded_by_us = isinstance(error, TimeoutError) and error.errno is None
        trace = "" if bounded_by_us else "".join(traceback.format_exception(error))
        self.emit(InternalError(text=text, traceback=trace))
