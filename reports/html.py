"""The page of the run as one file: everything that happened, to be opened without a network and years later.

The page itself and what goes into the file are ``rtf.page.archive``'s. With ``compare``, the folder of an earlier run,
and ``history``, the file of all runs (empty: the usual one), among the options, these are in the page, too.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rtf.testing.journal import FILE_NAME
from rtf.testing.report.files import Target
from rtf.testing.reporting import Reporter

if TYPE_CHECKING:
    from rtf.page.archive import Extras
    from rtf.testing.results import RunResult


class HtmlReporter(Reporter):
    """Writes ``report.html`` from the run's folder when the run is over. Without a target, to standard output."""

    plugin_name = "html"
    default_file = "report.html"

    _target: Target | None = None

    def open(self) -> None:
        """Make sure that the report can be written, and that there is what it is made from. Raises OSError."""
        target = Target(self.options.target)
        target.check()
        journal = self.options.run_folder / FILE_NAME
        if not journal.is_file():
            raise FileNotFoundError(f"the page is made from the run's folder, and there is no {journal}")
        if compare := self.options.extra.get("compare"):
            from rtf.page.compare import journal_of

            journal_of(Path(compare))
        self._target = target

    def update(self, results: RunResult) -> None:  # noqa: ARG002 - the journal has it
        """Write the page of the run so far, without what only a run that is over is compared with."""
        if self._target is not None and self._target.replaceable:
            self._write(self._target, None, last=False)

    def close(self, results: RunResult) -> None:
        """Write the file. The journal is complete: each event is in it before any reporter hears of it."""
        target, self._target = self._target, None
        if target is not None:
            self._write(target, self._extras(results), last=True)

    def _write(self, target: Target, extras: Extras | None, *, last: bool) -> None:
        from rtf.page.archive import write_archive

        with target.writing(last=last) as stream:
            write_archive(stream, self.options.run_folder, extras)

    def _extras(self, results: RunResult) -> Extras:
        from rtf.page.archive import Extras
        from rtf.page.compare import records
        from rtf.testing.history import History, HistoryError, default_place, trends_for_a_run

        wanted = self.options.extra
        compare = [*records(Path(wanted["compare"]))] if wanted.get("compare") else None
        if "history" not in wanted:
            return Extras(compare)
        path = Path(wanted["history"]) if wanted["history"] else default_place()
        started = results.started
        try:
            with History(path) as history:
                rig = (started.robot, started.station) if started else (None, None)
                found = trends_for_a_run(history, frozenset(results.suites), *rig)
        except HistoryError as error:  # a page without trends is better than none
            return Extras(compare, missing={str(path): str(error)})
        return Extras(compare, found)
