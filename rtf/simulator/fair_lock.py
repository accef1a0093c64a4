"""A fair lock between the loop of the simulation and the threads that command the robot."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from types import TracebackType


class FairLock:
    """A lock that the simulation's loop holds while it computes, and yields to waiting threads between two steps.

    A plain lock would starve them: a thread that releases a lock and takes it again at once always wins. Commands use
    ``with lock:`` and must be short. The loop uses ``acquire`` and ``release``, and calls ``yield_to_waiting`` after
    each step in which ``waiting`` is not 0. A thread that finds the lock free takes it without being counted.
    """

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._served = threading.Condition(threading.Lock())
        self.waiting = 0  # number of waiting threads
        self._gone = 0  # number of threads that have waited and were served

    def __enter__(self) -> Self:
        if not self._lock.acquire(blocking=False):
            self._wait()
        return self

    def _wait(self) -> None:
        with self._served:
            self.waiting += 1
        self._lock.acquire()
        with self._served:
            self.waiting -= 1
            self._gone += 1
            self._served.notify_all()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lock.release()

    def acquire(self) -> None:
        """Take the lock, for the loop."""
        self._lock.acquire()

    def release(self) -> None:
        """Release the lock."""
        self._lock.release()

    def yield_to_waiting(self) -> None:
        """Serve the threads that are waiting now, and take the lock again. For the loop, which holds it once.

        Threads that come meanwhile wait for the next call: an endless stream of commands must not stop the loop.
        """
        with self._served:
            until = self._gone + self.waiting
        self._lock.release()
        with self._served:
            self._served.wait_for(lambda: self._gone >= until)
        self._lock.acquire()
