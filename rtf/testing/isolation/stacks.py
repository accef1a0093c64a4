"""Files into which processes of ours dump their stacks when they are asked to, or when they crash."""

from __future__ import annotations

import contextlib
import os
from typing import TYPE_CHECKING

from rtf import clock
from rtf.testing.isolation.fork_server_protocol import DUMP_SIGNAL

if TYPE_CHECKING:
    from rtf.testing.isolation.reactor import Reactor
    from rtf.testing.isolation.worker_pool import Child

#: At most so much of what was dumped is kept.
_KEPT = 1 << 18
#: A dump that has not grown for so many seconds is written; and so long is waited for one at most.
_SETTLED = 0.02
_PATIENCE = 1.0


class StackFile:
    """A nameless file of the runner; readable when the process that dumps into it has died.

    ``descriptor`` is one that is there already, and becomes the object's own.
    """

    def __init__(self, descriptor: int | None = None) -> None:
        self._descriptor = os.memfd_create("rtf-stacks", os.MFD_CLOEXEC) if descriptor is None else descriptor
        self._read = 0

    @property
    def path(self) -> str:
        """Where another process of this user opens it, as long as the runner lives."""
        return f"/proc/{os.getpid()}/fd/{self._descriptor}"

    def new(self) -> str:
        """What has been dumped since the last call, at most 256 KiB of it."""
        size = self._size()
        data = os.pread(self._descriptor, min(size - self._read, _KEPT), self._read)
        self._read = size
        return data.decode("utf-8", "backslashreplace")

    def dump(self, child: Child, reactor: Reactor) -> None:
        """Have a process dump its stacks, and wait until that is written: at most a second, if it does not answer.

        Nothing else may be asked of it meanwhile: the dump reads the frames of threads that go on, and a thread that
        leaves its frames at that moment, because it was told to stop, takes the process with it.
        """
        before = size = self._size()
        patience = clock.Deadline.after(_PATIENCE)
        child.signal(DUMP_SIGNAL)
        while not patience.expired and child.end is None:
            pause = clock.Deadline.after(_SETTLED)
            while not pause.expired:
                reactor.run_once(pause)
            last, size = size, self._size()
            if before < size == last:
                return

    def _size(self) -> int:
        return os.fstat(self._descriptor).st_size

    def close(self) -> None:
        """Give it back."""
        with contextlib.suppress(OSError):
            os.close(self._descriptor)
