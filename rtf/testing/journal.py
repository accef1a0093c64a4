"""The journal: an append-only record of a run, one event a line, from which everything can be rebuilt.

It is complete at every instant: each event is in the kernel's hands before anybody else hears of it, so that not even
``kill -9`` of the runner loses one, and on the disk soon after each test's end. There is one writer. A reader
tolerates a last line that was torn by a crash of the machine.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import threading
from typing import TYPE_CHECKING, Self

from rtf.testing.events import Event, EventError, UnknownEventError, from_line, to_line
from rtf.testing.outcome import TestingError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path
    from types import TracebackType

FILE_NAME = "journal.jsonl"

#: Seconds between two turns of the disk. Each costs the run some wake-ups of a thread that competes with it.
_SYNC_PAUSE = 0.1


class JournalError(TestingError, OSError):
    """The journal cannot be written or is none."""


class Journal:
    """The writer of a journal. Safe to use from several threads, one writer a file."""

    def __init__(self, path: Path, *, resume: bool = False) -> None:
        self.path = path
        flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC | (0 if resume else os.O_EXCL)
        try:
            self._descriptor = os.open(path, flags, 0o644)
            _claim(self._descriptor)
            if resume:
                _repair_torn_end(path)
        except OSError as error:
            raise JournalError(error.errno, f"cannot write the journal {path}: {error.strerror}") from None
        self._lock = threading.Lock()
        self._dirty = threading.Event()
        self._closing = False
        self._close_now = threading.Event()
        # The disk is told by a thread of its own: the next test need not wait for it, and tests that follow each other
        # quickly share one turn of it.
        self._syncer = threading.Thread(target=self._keep_syncing, name="rtf-journal-sync", daemon=True)
        self._syncer.start()

    def append(self, event: Event) -> None:
        """Write one event. Raises JournalError when the disk is full or gone."""
        line = to_line(event)
        with self._lock:
            try:
                view = memoryview(line)
                while view:
                    view = view[os.write(self._descriptor, view) :]
            except OSError as error:
                raise JournalError(error.errno, f"cannot write the journal {self.path}: {error.strerror}") from None

    def sync(self) -> None:
        """Have what was written so far put on the disk, soon."""
        self._dirty.set()

    def close(self) -> None:
        """Put everything on the disk, and be done. Raises JournalError when the disk does not take it."""
        if self._closing:
            return
        self._closing = True
        self._close_now.set()
        self._dirty.set()
        self._syncer.join()
        try:
            os.fsync(self._descriptor)
        except OSError as error:
            raise JournalError(error.errno, f"cannot write the journal {self.path}: {error.strerror}") from None
        finally:
            os.close(self._descriptor)

    def close_quietly(self) -> None:
        """Be done with a journal that cannot be written any more."""
        with contextlib.suppress(OSError):
            self.close()

    def _keep_syncing(self) -> None:
        while True:
            self._dirty.wait()
            self._dirty.clear()
            if self._closing:
                return
            with contextlib.suppress(OSError):  # the next write meets the same error, and says so
                os.fsync(self._descriptor)
            self._close_now.wait(_SYNC_PAUSE)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _claim(descriptor: int) -> None:
    """Be the one writer until this process ends, however it ends: a run that is still going on is not resumed."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        os.close(descriptor)
        raise OSError(error.errno, "another runner is writing it") from None
    except OSError:
        return  # a file system that knows no locks has to be trusted


def _repair_torn_end(path: Path) -> None:
    """Cut off a last line that has no end, so that what is appended begins on a line of its own."""
    with path.open("rb+") as stream:
        size = stream.seek(0, os.SEEK_END)
        position = size
        while position:
            step = min(position, 1 << 16)
            position -= step
            stream.seek(position)
            newline = stream.read(step).rfind(b"\n")
            if newline >= 0:
                position += newline + 1
                break
        if position != size:
            stream.truncate(position)


class JournalReader:
    """Reads a journal from its beginning, and what is appended to it later.

    A last line without its end waits for it; events of a newer RTF are passed over. Raises JournalError when there is
    no such file, and EventError for a line in the middle that is no event.
    """

    def __init__(self, path: Path) -> None:
        self._run = path
        self.path = path / FILE_NAME if path.is_dir() else path
        self._offset = 0
        self._line = 0

    def new_events(self) -> Iterator[Event]:
        """Yield the events that were appended since the last time, in order."""
        try:
            stream = self.path.open("rb")
        except FileNotFoundError:
            raise JournalError(f"there is no run in {self._run}: {self.path} is missing") from None
        except OSError as error:
            raise JournalError(f"cannot read the journal {self.path}: {error.strerror}") from None
        with stream:
            stream.seek(self._offset)
            damage: EventError | None = None  # an error if another line follows: the end of a file may be lost
            for line in stream:
                if damage is not None:
                    raise damage
                if not line.endswith(b"\n"):
                    return
                try:
                    event = from_line(line)
                except UnknownEventError:
                    event = None
                except EventError as error:
                    damage = EventError(f"{self.path}:{self._line + 1}: {error}")
                    continue
                self._offset += len(line)
                self._line += 1
                if event is not None:
                    yield event


def read(path: Path) -> Iterator[Event]:
    """Yield the events of a journal, or of a run's folder, in order. Raises as :class:`JournalReader` does."""
    return JournalReader(path).new_events()
