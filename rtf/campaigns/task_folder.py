"""The folders in which runs of campaigns work. One that a killed process has left is removed by the next process.

Each folder has a file that is locked while its process, or the runner that it has started, lives.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator

_PREFIX = "rtf-campaign-"
_LOCK = "in-use"


class TaskFolder(NamedTuple):
    """A folder, and the descriptor that keeps it: a runner that inherits it keeps the folder, too."""

    path: Path
    keeper: int


@contextmanager
def task_folder() -> Iterator[TaskFolder]:
    """Make a folder for a run, and remove it afterwards. Raises OSError."""
    _remove_left()
    with tempfile.TemporaryDirectory(prefix=_PREFIX, ignore_cleanup_errors=True) as name:
        path = Path(name)
        unlocked = path / f"{_LOCK}.new"
        with unlocked.open("wb") as stream:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            unlocked.rename(path / _LOCK)  # no other process sees it before it is locked
            yield TaskFolder(path, stream.fileno())


@cache
def _remove_left() -> None:
    """Remove what killed processes of this user have left; once a process."""
    for folder in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        try:
            if folder.is_symlink() or folder.stat().st_uid != os.getuid():
                continue
            with (folder / _LOCK).open("rb") as stream:
                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(folder, ignore_errors=True)
        except OSError:
            continue  # in use, not of a run, or removed by another process
