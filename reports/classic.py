"""The console of the C++ framework, line for line.

Verbosity 0 shows errors, failures and the totals, as the C++ framework does without ``-v``; with 1 everything is shown.
Colours appear only where a person sees them.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, TextIO

from rtf.testing.report.lines import lines, summary
from rtf.testing.report.text import encodable, wants_colour
from rtf.testing.reporting import Reporter

if TYPE_CHECKING:
    from rtf.testing.events import Event
    from rtf.testing.report.lines import Line
    from rtf.testing.results import RunResult

#: The C++ framework's colours, but for its grey, which is black and cannot be read on a dark terminal.
_COLOURS = {"start": "94", "passed": "92", "failed": "91", "fail": "91", "error": "91", "info": "90"}


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
                self._print(self._formatted(line))

    def close(self, results: RunResult) -> None:
        """Print the totals."""
        if self.options.extra.get("summary") != "no":
            self._print(summary(results, "results"))
        self._stream = None

    def _formatted(self, line: Line) -> str:
        text = f"{line.tag}{line.text}"
        if self._coloured:
            start = f"\x1b[{_COLOURS[line.kind]}m"
            text = f"{start}{line.tag}\x1b[0m{line.text}" if line.tag else f"{start}{line.text}\x1b[0m"
        return f"{text}\n{line.place}\n\n" if line.place and self.options.detail else f"{text}\n"

    def _print(self, text: str) -> None:
        stream = self._stream
        if stream is None:
            return
        try:
            stream.write(encodable(text, stream.encoding))
            stream.flush()
        except BrokenPipeError:  # whoever read it has seen enough
            self._stream = None
