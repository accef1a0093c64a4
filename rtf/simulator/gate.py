"""The gate between the simulation's loop and everybody who commands the robot meanwhile."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from types import TracebackType


class Gate:
    """A lock that the loop holds while it computes, and gives to those who wait between two steps.

    A plain lock would starve them: who releases it and takes it again at once always wins. ``with gate:`` is for
    commands, which must be quick; the loop takes it with ``enter`` and calls ``pass_on`` after each step if ``wanted``.
    Who finds it free waits for nobody, and is not counted.
    """

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._served = threading.Condition(threading.Lock())
        self.wanted = 0  # how many wait
        self._gone = 0  # how many have waited, and had it

    def __enter__(self) -> Self:
        if not self._lock.acquire(blocking=False):
            self._wait()
        return self

    def _wait(self) -> None:
        with self._served:
            self.wanted += 1
        self._lock.acquire()
        with self._served:
            self.wanted -= 1
            self._gone += 1
            self._served.notify_all()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lock.release()

    def enter(self) -> None:
        """Take it, for the loop."""
        self._lock.acquire()

    def leave(self) -> None:
        """Give it back."""
        self._lock.release()

    def pass_on(self) -> None:
        """Let as many have it as wait now, and take it again after them. For the loop, which holds it once.

        Those who come meanwhile wait for the next time, or commands without end would stop the loop.
        """
        with self._served:
            until = self._gone + self.wanted
        self._lock.release()
        with self._served:
            self._served.wait_for(lambda: self._gone >= until)
        self._lock.acquire()
