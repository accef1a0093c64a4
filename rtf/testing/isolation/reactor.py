"""The wait of a suite worker: for the processes that it has started, and for its deadlines."""

from __future__ import annotations

import contextlib
import os
import select
from typing import TYPE_CHECKING

from rtf import clock

if TYPE_CHECKING:
    from collections.abc import Callable

#: Seconds of a wait at most: a signal that comes just before it does not end it, and is looked at after it.
_LOOK = 0.25


class Reactor:
    """The one wait of a suite worker: for the first event among its files and its deadline.

    It calls a function for each file that has become readable. Used by one thread; ``wake`` by any, and by signals.
    """

    def __init__(self) -> None:
        self._epoll = select.epoll()
        self._callbacks: dict[int, Callable[[], object]] = {}
        self._later: dict[Callable[[], None], clock.Deadline] = {}
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self.watch(self._wake, self._woken)

    def watch(self, descriptor: int, callback: Callable[[], object]) -> None:
        """Call ``callback`` whenever ``descriptor`` is readable or closed by its other end."""
        self._callbacks[descriptor] = callback
        self._epoll.register(descriptor, select.EPOLLIN)

    def unwatch(self, descriptor: int) -> None:
        """Forget a file; to be called before it is closed."""
        if self._callbacks.pop(descriptor, None) is not None:
            self._epoll.unregister(descriptor)

    def call_later(self, seconds: float, callback: Callable[[], None]) -> None:
        """Call ``callback`` once, in so many seconds."""
        self._later[callback] = clock.Deadline.after(seconds)

    def cancel(self, callback: Callable[[], None]) -> None:
        """Cancel the later call."""
        self._later.pop(callback, None)

    def run_once(self, deadline: clock.Deadline) -> None:
        """Wait until something happened, or for a moment at most, and make the calls that are due."""
        for moment in self._later.values():
            deadline = deadline.earliest(moment)
        for descriptor, _ in self._epoll.poll(min(deadline.remaining(), _LOOK)):
            reader = self._callbacks.get(descriptor)
            if reader is not None:  # an earlier callback may have unwatched it
                reader()
        for callback in [callback for callback, moment in self._later.items() if moment.expired]:
            if self._later.pop(callback, None) is not None:  # an earlier one may have cancelled it
                callback()

    def wake(self) -> None:
        """End the wait. Safe in signal handlers and other threads."""
        with contextlib.suppress(OSError):
            os.eventfd_write(self._wake, 1)

    def _woken(self) -> None:
        with contextlib.suppress(BlockingIOError):
            os.eventfd_read(self._wake)

    def close(self) -> None:
        """Close the descriptors."""
        self._epoll.close()
        os.close(self._wake)
