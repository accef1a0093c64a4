"""Reporters, and the one order in which all hear of everything.

A reporter is a plug-in that listens to a run's events and shows them or writes them down. It has no privilege: what it
hears live it can hear again from the journal. A reporter that breaks is told of and left out; the run goes on.
"""

from __future__ import annotations

import threading
import traceback
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from rtf.testing import journal, replay
from rtf.testing.events import Event, InternalError, RunStarted, SuiteEnded, TestEnded
from rtf.testing.journal import Journal, JournalError
from rtf.testing.outcome import TestingError
from rtf.testing.results import RunResult

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping
    from pathlib import Path

    from rtf.testing.run_control import Control


@dataclass(frozen=True, slots=True)
class ReportOptions:
    """What a reporter is given: where its file goes, where the run's folder is, how much it is to say.

    ``verbosity`` is -1 for quiet, 0, 1 or 2. ``extra`` holds options of the reporter's own, by name. ``control`` is the
    way to stop the run and to answer its questions; a run that is over has none.
    """

    target: Path | None
    run_folder: Path
    verbosity: int = 0
    detail: bool = False
    colour: bool | None = None  # None: decide by the terminal and the environment
    extra: Mapping[str, str] = field(default_factory=dict)
    control: Control | None = None


class Reporter:
    """Base of reporter plug-ins. Events come in the run's one order, one at a time, from any thread.

    ``plugin_name`` is the name on the command line; ``default_file`` the name of its file inside the run's folder, or
    empty for a reporter that writes none.
    """

    plugin_name: ClassVar[str] = ""
    aliases: ClassVar[tuple[str, ...]] = ()
    default_file: ClassVar[str] = ""

    def __init__(self, options: ReportOptions) -> None:
        self.options = options

    def open(self) -> None:
        """Get ready; called before the run. Raises when the report could never be written, so that nothing is lost."""

    def handle(self, event: Event, results: RunResult) -> None:
        """Take one event; ``results`` has it in already. Must be quick: the run waits."""

    def close(self, results: RunResult) -> None:
        """Write what is still to be written; called on every exit path."""

    def linger(self) -> None:
        """Called last of all, in the main thread, when the journal is closed: what people look at may stay a while."""

    def paths(self) -> tuple[Path, ...]:
        """The files that people may want to open when the run is over."""
        return (self.options.target,) if self.options.target is not None else ()


class ReportError(TestingError, OSError):
    """A report that was asked for cannot be written, or no reporter has that name."""


def load_reporter(name: str) -> type[Reporter]:
    """The reporter plug-in of this name along the search path. Raises PluginError."""
    from rtf.testing import plugins

    return plugins.load_class(plugins.find("report", name), Reporter)


class Broadcast:
    """Gives every event its place in the order, writes it down, and tells the reporters. Thread-safe."""

    def __init__(self, to: Journal | None, reporters: list[Reporter], *, results: RunResult | None = None) -> None:
        self.results = results or RunResult()
        self.reporters = reporters
        self.control: Control | None = None
        self._journal = to
        self._lock = threading.RLock()
        self._seq = 0

    def replay(self, events: Iterable[Event]) -> None:
        """Tell of events that are in the journal already, and go on counting after them."""
        with self._lock:
            for event in events:
                self._seq = max(self._seq, event.seq)
                self._tell(event)

    def resume(self, path: Path, void: Collection[str] = ()) -> None:
        """Tell of what a run has come to that is resumed now, and go on counting where its journal stops.

        The suites and tests in ``void`` are no part of it any more.
        """
        self.replay(replay.as_one_run(path, resuming=True, void=void))
        self._seq = max((event.seq for event in journal.read(path)), default=0)

    def emit(self, event: Event) -> None:
        """Tell of one event. First it is written down: what a report shows is in the journal already."""
        with self._lock:
            self._seq += 1
            event = event.with_seq(self._seq)
            self._write(event)
            self._tell(event)

    def _tell(self, event: Event) -> None:
        self.results.apply(event)
        if self.control is not None:
            self.control.note(event)
        for reporter in [*self.reporters]:
            try:
                reporter.handle(event, self.results)
            except Exception as error:  # noqa: BLE001 - told of, and the run goes on without this reporter
                self._drop(reporter, error)

    def close_reporters(self) -> None:
        """Let every reporter finish, once, the first one last: it can still tell of another one that breaks."""
        with self._lock:
            while self.reporters:
                reporter = self.reporters.pop()
                try:
                    reporter.close(self.results)
                except Exception as error:  # noqa: BLE001 - told of, and the others still finish
                    self._drop(reporter, error)

    def close(self) -> None:
        """Let every reporter finish, and close the journal."""
        with self._lock:
            self.close_reporters()
            written, self._journal = self._journal, None
            if written is not None:
                try:
                    written.close()
                except JournalError as error:
                    self.emit(InternalError(text=str(error)))

    def _write(self, event: Event) -> None:
        if self._journal is None:
            return
        try:
            self._journal.append(event)
        except JournalError as error:
            # The run goes on for the reporters' sake; the exit code and the console tell.
            self._journal.close_quietly()
            self._journal = None
            self.emit(InternalError(text=str(error)))
            return
        if isinstance(event, TestEnded | SuiteEnded | RunStarted):
            self._journal.sync()

    def _drop(self, reporter: Reporter, error: Exception) -> None:
        if reporter in self.reporters:
            self.reporters.remove(reporter)
        name = type(reporter).plugin_name or type(reporter).__name__
        text = f"reporter {name} broke and is left out: {type(error).__name__}: {error}"
        self.emit(InternalError(text=text, traceback=traceback.format_exc()))
