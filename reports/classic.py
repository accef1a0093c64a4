"""The console of the C++ framework, line for line.

Verbosity 0 shows errors, failures and the totals, as the C++ framework does without ``-v``; with 1 everything is shown.
Colours appear only where a person sees them.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, TextIO

from rtf.testing.report.lines import formatted, lines, summary
from rtf.testing.report.text import encodable, wants_colour
from rtf.testing.reporting import Reporter

if TYPE_CHECKING:
    from rtf.testing.events import Event
    from rtf.testing.results import RunResult


class ClassicReporter(Reporter):
    """Prints to standard output what the C++ framework printed.

    ``detail`` adds the places; with the option ``summary`` ``no`` the totals are left out.
    """

    plugin_name = "classic"
    patience = 600.0  # a person may hold the screen

    _stream: TextIO | None = None
    _coloured = False

    def open(self) -> None:
        """Find out whether a person looks."""
        self._stream = sys.stdout
        self._coloured = wants_colour(sys.stdout, self.options.colour)

    def handle(self, event: Event, results: RunResult) -> None:
        """Print the lines of one event."""
        for line in lines(event, results):
            if line.critical or self.options.verbosity > 0:
                self._print(formatted(line, detail=self.options.detail, coloured=self._coloured))

    def close(self, results: RunResult) -> None:
        """Print the totals."""
        if self.options.extra.get("summary") != "no":
            self._print(summary(results, "results"))
        self._stream = None

    def _print(self, text: str) -> None:
        stream = self._stream
        if stream is None:
            return
        try:
            stream.write(encodable(text, stream.encoding))
            stream.flush()
        except BrokenPipeError:  # the reader has seen enough
            self._stream = None
