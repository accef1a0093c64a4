"""The result file of the C++ framework: every event as a line, then the totals.

Unlike the C++ framework's it is written while the run goes on, so that a runner that is killed leaves what was known.
The file is complete when it ends with the summary, which is written in one piece. It contains everything, whatever the
verbosity; ``detail`` adds the places.
"""

from __future__ import annotations

import io
import os
from contextlib import suppress
from typing import TYPE_CHECKING

from rtf.testing.events import SuiteEnded, TestEnded
from rtf.testing.report.files import Target
from rtf.testing.report.lines import formatted, lines, summary
from rtf.testing.reporting import Reporter

if TYPE_CHECKING:
    from rtf.testing.events import Event
    from rtf.testing.results import RunResult


class TextReporter(Reporter):
    """Writes ``result.txt``. Without a target it writes to standard output."""

    plugin_name = "text"
    default_file = "result.txt"

    def open(self) -> None:
        """Begin the file anew. Raises OSError when it cannot be written."""
        target = Target(self.options.target)
        target.check()
        self._stream = io.TextIOWrapper(target.open(), encoding="utf-8", errors="backslashreplace", newline="\n")

    def handle(self, event: Event, results: RunResult) -> None:
        """Write the lines of one event; at a test's end all that was written leaves the process."""
        try:
            for line in lines(event, results):
                if not line.runner:
                    self._stream.write(formatted(line, detail=self.options.detail))
            if isinstance(event, TestEnded | SuiteEnded):
                self._stream.flush()
        except OSError:
            with suppress(OSError):  # the same again
                self._stream.close()
            raise

    def close(self, results: RunResult) -> None:
        """Write the totals, and have the file on the disk."""
        with self._stream as stream:
            stream.flush()
            stream.write(summary(results, "summary"))
            stream.flush()
            if stream.seekable():
                os.fsync(stream.fileno())
