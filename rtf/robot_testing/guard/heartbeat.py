"""The heartbeat of guards: a file by which the fixture ``robot`` sees that those of a test are alive and watch.

Guards that have begun to watch write the time of every check into a file of the run folder, which has a lock.
The lock ends with the process, however that dies; a stopped process stops writing. The fixture answers in the same
file, if it had to stop the robot. The times are those of the machine's monotonic clock, which processes share.
"""

from __future__ import annotations

import fcntl
import os
import struct
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from rtf import clock

if TYPE_CHECKING:
    from collections.abc import Iterator

_RUN_FOLDER = "RTF_RUN_FOLDER"
_FOLDER = "heartbeats"
_TIME = struct.Struct("d")
#: Where the answer begins, and its greatest length.
_ANSWER, _LONGEST = 16, 4096


def _folder_of(robot: str, folder: str | Path) -> Path:
    """Return the folder of a robot's heartbeats: a run may have several robots, with a supervisor each."""
    return Path(folder, _FOLDER, quote(robot.strip("/"), safe=""))


class Heartbeat:
    """The heartbeat of the guards of a test on a robot, shared by them. Without a run folder it does nothing."""

    def __init__(self, robot: str) -> None:
        self._file = -1
        folder = os.environ.get(_RUN_FOLDER)
        if folder is None:
            return
        self._path = _folder_of(robot, folder) / str(os.getpid())
        self._path.parent.mkdir(parents=True, exist_ok=True)
        # Where nobody looks: without its lock it would be that of a dead process.
        unlocked = self._path.with_name(f".{os.getpid()}")
        self._file = os.open(unlocked, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o600)
        fcntl.flock(self._file, fcntl.LOCK_EX)
        unlocked.rename(self._path)

    def beat(self) -> str:
        """Write that the guard watches now. Return why the robot was stopped meanwhile, once; "" if it was not."""
        if self._file < 0:
            return ""
        os.pwrite(self._file, _TIME.pack(clock.monotonic()), 0)
        answer = os.pread(self._file, _LONGEST, _ANSWER)
        if answer:
            os.ftruncate(self._file, _ANSWER)
        return answer.decode(errors="replace")

    def close(self) -> None:
        """End the heartbeat: the guards do not watch any more, and all parts are restored."""
        if self._file >= 0:
            self._path.unlink(missing_ok=True)
            os.close(self._file)
            self._file = -1


class Heard:
    """A heartbeat as the fixture sees it."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file = os.open(path, os.O_RDWR | os.O_CLOEXEC)

    def is_orphaned(self) -> bool:
        """Return whether the process of the guard has died."""
        try:
            fcntl.flock(self._file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return self._path.exists()  # one that was closed has no file any more

    def silence(self) -> float:
        """Return for how long the guard has not watched (s); 0 before it begins to."""
        written = os.pread(self._file, _TIME.size, 0)
        return clock.monotonic() - _TIME.unpack(written)[0] if len(written) == _TIME.size else 0.0

    def answer(self, text: str) -> None:
        """Tell the guard that the robot was stopped."""
        os.pwrite(self._file, text.encode()[:_LONGEST], _ANSWER)

    def forget(self) -> None:
        """Remove the file of a process that has died."""
        self._path.unlink(missing_ok=True)

    def close(self) -> None:
        """Close the file."""
        os.close(self._file)


def heartbeats(folder: str | Path, robot: str) -> Iterator[Heard]:
    """Yield the heartbeats of a robot's tests in a run folder, each open until the next."""
    for path in sorted(_folder_of(robot, folder).glob("[0-9]*")):
        try:
            heard = Heard(path)
        except FileNotFoundError:  # closed meanwhile
            continue
        try:
            yield heard
        finally:
            heard.close()
