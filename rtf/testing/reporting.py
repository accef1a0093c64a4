"""Reporters: the class an author derives from, its options, and how it is found.

A reporter is a plug-in that receives a run's events and shows them or writes them down. It has no privilege: the
journal has all that it receives live. A reporter that breaks is reported and left out; the run goes on.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from rtf.testing.verdict import TestingError

if TYPE_CHECKING:
    import threading
    from collections.abc import Mapping
    from pathlib import Path

    from rtf.testing.events import Event
    from rtf.testing.results import RunResult
    from rtf.testing.run_control import Control

#: Seconds that a call may take, and ``close``, which may have to write the whole report.
CALL_LIMIT, CLOSE_LIMIT = 10.0, 30.0


@dataclass(frozen=True, slots=True)
class ReportOptions:
    """The options of a reporter: the target of its file, the run's folder, its verbosity.

    ``verbosity`` is -1 for quiet, 0, 1 or 2. ``extra`` holds options of the reporter's own, by name. ``control`` is the
    way to stop the run and to answer its questions; a run that is over has none. All reporters of a run share
    ``unwritten``: the files that are incomplete, each with the reason.
    """

    target: Path | None
    run_folder: Path
    verbosity: int = 0
    detail: bool = False
    colour: bool | None = None  # None: decide by the terminal and the environment
    extra: Mapping[str, str] = field(default_factory=dict)
    control: Control | None = None
    unwritten: dict[Path, str] = field(default_factory=dict)


class Reporter:
    """Base of reporter plug-ins. All reporters of a run are called one after the other, in the run's one order.

    ``plugin_name`` is the name on the command line; ``default_file`` the name of its file inside the run's folder, or
    empty for a reporter that writes none. A call that takes longer than ``patience`` seconds (``patience_of_close`` for
    the calls at the end) is abandoned: the reporter is named and gets no more events, and the exit code is 3.
    """

    plugin_name: ClassVar[str] = ""
    aliases: ClassVar[tuple[str, ...]] = ()
    default_file: ClassVar[str] = ""
    patience: ClassVar[float] = CALL_LIMIT
    patience_of_close: ClassVar[float] = CLOSE_LIMIT

    #: Whether :meth:`linger` stays until it is asked to end.
    stays = False

    def __init__(self, options: ReportOptions) -> None:
        self.options = options

    def open(self) -> None:
        """Prepare; called before the run. Raises when the report could never be written, so that nothing is lost."""

    def handle(self, event: Event, results: RunResult) -> None:
        """Take one event, which ``results`` includes already. Must be quick: the run waits."""

    def update(self, results: RunResult) -> None:
        """Complete the report as far as the run has come; called about once a second while something happens."""

    def close(self, results: RunResult) -> None:
        """Write what is still to be written; called on every exit path."""

    def linger(self, stop: threading.Event) -> None:
        """Called last of all, when the journal is closed. One that ``stays`` returns when ``stop`` is set."""

    def paths(self) -> tuple[Path, ...]:
        """The files that people may want to open when the run is over."""
        return (self.options.target,) if self.options.target is not None else ()


class ReportError(TestingError, OSError):
    """A report that was asked for cannot be written, or no reporter has that name."""


def load_reporter(name: str) -> type[Reporter]:
    """The reporter plug-in of this name along the search path. Raises PluginError."""
    from rtf.testing import plugins

    return plugins.load_class(plugins.find("report", name), Reporter)
