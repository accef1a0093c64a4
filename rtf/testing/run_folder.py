"""The folder of a run: named by time and by what is run, so that sorting by name is sorting by age."""

from __future__ import annotations

import contextlib
import os
from typing import TYPE_CHECKING

from rtf import clock
from rtf.testing.events import FixtureChanged, TestEnded, TestStarted
from rtf.testing.reporting import Reporter

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.testing.events import Event
    from rtf.testing.reporting import ReportOptions
    from rtf.testing.results import RunResult

LATEST = "latest"
_MOST_A_SECOND = 1000


def make_run_folder(runs: Path, *words: str) -> Path:
    """Make a new folder in ``runs``, named by now and these words. Raises OSError."""
    stem = "_".join(part.replace("/", "-") for part in (clock.local_stamp(clock.now()), *words) if part)
    for count in range(1, _MOST_A_SECOND):
        folder = runs / (stem if count == 1 else f"{stem}~{count}")
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            continue
        return folder
    raise FileExistsError(f"{runs}: there are a thousand runs of this second already")


class LatestRun(Reporter):
    """Points ``latest``, beside the run's folder, to a run as soon as it does something.

    A run that is refused before that, or in which nothing is selected, leaves the link at the run before.
    """

    plugin_name = "latest"

    def __init__(self, options: ReportOptions) -> None:
        super().__init__(options)
        self._pointed = False

    def handle(self, event: Event, results: RunResult) -> None:  # noqa: ARG002 - the first event decides
        if not self._pointed and isinstance(event, TestStarted | TestEnded | FixtureChanged):
            self._pointed = True
            _point_to(self.options.run_folder.with_name(LATEST), self.options.run_folder.name)


def _point_to(link: Path, name: str) -> None:
    temporary = link.with_name(f".{LATEST}.{os.getpid()}")
    with contextlib.suppress(OSError):  # a file system without links has no 'latest', and that is all
        temporary.symlink_to(name)
        temporary.replace(link)
