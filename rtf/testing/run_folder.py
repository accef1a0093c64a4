"""The folder of a run: named by time and by what is run, so that sorting by name is sorting by age."""

from __future__ import annotations

import contextlib
import os
from typing import TYPE_CHECKING

from rtf import clock

if TYPE_CHECKING:
    from pathlib import Path

LATEST = "latest"
_MOST_A_SECOND = 1000


def make_run_folder(runs: Path, *words: str) -> Path:
    """Make a new folder in ``runs``, named by now and these words, and point ``latest`` to it. Raises OSError."""
    stem = "_".join(part.replace("/", "-") for part in (clock.local_stamp(clock.now()), *words) if part)
    for count in range(1, _MOST_A_SECOND):
        folder = runs / (stem if count == 1 else f"{stem}~{count}")
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            continue
        _point_to(runs / LATEST, folder.name)
        return folder
    raise FileExistsError(f"{runs}: there are a thousand runs of this second already")


def _point_to(link: Path, name: str) -> None:
    temporary = link.with_name(f".{LATEST}.{os.getpid()}")
    with contextlib.suppress(OSError):  # a file system without links has no 'latest', and that is all
        temporary.symlink_to(name)
        temporary.replace(link)
