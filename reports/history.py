"""Keeps verdicts and measurements of a run in the station's history; ``testrunner history`` shows what became of them.

The target is the SQLite file, or none for the user's own. Many runs share it, several at a time. A history that cannot
be opened is an error before the run. One that cannot take the run in when it is over is reported on standard error and
changes no verdict: the journal has everything, and ``testrunner history --import`` takes the run in later.
"""

from __future__ import annotations

import atexit
import sys
from typing import TYPE_CHECKING

from rtf.errors import RtfError
from rtf.testing.history import History, default_place
from rtf.testing.history.database import record_run
from rtf.testing.journal import FILE_NAME
from rtf.testing.report.text import shown
from rtf.testing.reporting import Reporter

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.testing.results import RunResult


class HistoryReporter(Reporter):
    """Puts the run into the history when it is over, from its journal."""

    plugin_name = "history"

    def open(self) -> None:
        """Make sure that the history can be written; makes it, or brings it up to date. Raises OSError."""
        journal = self.options.run_folder / FILE_NAME
        if not journal.is_file():
            raise FileNotFoundError(f"measurements are taken from the run's folder, and there is no {journal}")
        self._path = self.options.target or default_place()
        with History(self._path, create=True) as history:
            history.check_writable()

    def close(self, results: RunResult) -> None:
        """Put the run in."""
        try:
            with History(self._path, create=True) as history:
                record_run(history, self.options.run_folder, results)
        except RtfError as error:
            text = (
                f"history: this run is not in it: {error}\n"
                f"history: to put it in: testrunner history --import {self.options.run_folder} --history {self._path}"
            )
            # Said when everything else is said: a console that is still redrawing itself would wipe it out.
            atexit.register(print, shown(text), file=sys.stderr)

    def paths(self) -> tuple[Path, ...]:
        """None: the file is for ``testrunner history``, not for opening."""
        return ()
