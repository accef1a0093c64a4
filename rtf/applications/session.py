"""The session of an application: one manager of a machine at a time runs it, and others learn which.

The kernel releases the lock with the process. A manager that ends in order leaves an empty file, one that is killed
leaves its number.
"""

from __future__ import annotations

import fcntl
import os
from typing import TYPE_CHECKING, Self

from rtf import clock
from rtf.applications.errors import ApplicationError, TakenError

if TYPE_CHECKING:
    from pathlib import Path
    from types import TracebackType

_LOOK = 0.05


class Session:
    """The session, held from construction to ``close``. Raises TakenError while another process holds it.

    ``unfinished``: the manager before was killed.
    """

    def __init__(self, path: Path) -> None:
        try:
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        except OSError as error:
            raise ApplicationError(f"{path} cannot be used: {error.strerror}; set XDG_STATE_HOME") from None
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            pid = _number(self._file)
            os.close(self._file)
            raise TakenError(pid) from None
        self.unfinished = _number(self._file) > 0
        os.ftruncate(self._file, 0)
        os.pwrite(self._file, str(os.getpid()).encode(), 0)

    def close(self) -> None:
        """End the session."""
        os.ftruncate(self._file, 0)
        os.close(self._file)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def holder(path: Path) -> int:
    """Return the process that holds the session, 0 if there is none. The session is not touched."""
    try:
        file = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return 0
    try:
        pid = _number(file)
        if pid:
            os.kill(pid, 0)
    except ProcessLookupError:
        return 0
    except PermissionError:
        return pid
    finally:
        os.close(file)
    return pid


def await_session(path: Path, timeout: float) -> Session:
    """Wait until the session is free, and hold it. Raises TakenError after ``timeout`` seconds."""
    deadline = clock.Deadline.after(timeout)
    while True:
        try:
            return Session(path)
        except TakenError:
            if deadline.expired:
                raise
        clock.sleep(_LOOK)


def _number(file: int) -> int:
    text = os.pread(file, 32, 0)
    return int(text) if text.isdigit() else 0
