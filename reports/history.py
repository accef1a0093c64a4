"""Keeps verdicts and measurements of a run in the station's history; ``testrunner history`` shows what became of them.

The target is the SQLite file, or none for the user's own. Many runs share it, several at a time. A history that cannot
be opened is an error before the run. One that cannot take the run in when it is over is told of on standard error and
changes no verdict: the journal has everything, and ``testrunner history --import`` takes the run in later.
"""

from __future__ import annotations

import atexit
import sys
from typing import TYPE_CHECKING

from rtf.testing.history import History, HistoryError, default_place
from rtf.testing.history.recorder import Recorder
from rtf.testing.report.text import shown
from rtf.testing.reporting import Reporter

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.testing.events import Event
    from rtf.testing.results import RunResult


class HistoryReporter(Reporter):
    """Puts the run into the history when it is over."""

    plugin_name = "history"

    _recorder: Recorder | None = None

    def open(self) -> None:
        """Make sure that the history can be written; makes it, or brings it up to date. Raises HistoryError."""
        self._path = self.options.target or default_place()
        with History(self._path, create=True) as history:
            history.check_writable()
        self._recorder = Recorder()

    def handle(self, event: Event, results: RunResult) -> None:  # noqa: ARG002 - the results are asked at the end
        """Take one event."""
        if self._recorder is None:
            return
        try:
            self._recorder.take(event)
        except HistoryError as error:
            self._give_up(error)

    def close(self, results: RunResult) -> None:
        """Put the run in."""
        if self._recorder is None:
            return
        try:
            with History(self._path, create=True) as history:
                self._recorder.save(history, results, self.options.run_folder)
        except HistoryError as error:
            self._give_up(error)
        else:
            self._drop()

    def paths(self) -> tuple[Path, ...]:
        """None: the file is for ``testrunner history``, not for opening."""
        return ()

    def _give_up(self, error: HistoryError) -> None:
        self._drop()
        text = (
            f"history: this run is not in it: {error}\n"
            f"history: to put it in: testrunner history --import {self.options.run_folder} --history {self._path}"
        )
        # Said when everything else is said: a console that is still redrawing itself would wipe it out.
        atexit.register(print, shown(text), file=sys.stderr)

    def _drop(self) -> None:
        if self._recorder is not None:
            self._recorder.close()
        self._recorder = None
