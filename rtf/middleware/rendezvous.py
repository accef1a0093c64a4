"""Where the thread of an input meets the one that reads the port: the sender waits until its message has been read."""

from __future__ import annotations

import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rtf import clock
from rtf.middleware.errors import PortClosedError, WaitTimeoutError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.delivery import Delivery


class Rendezvous:
    """Hands deliveries over one at a time. ``whose`` is the port's name, for errors."""

    def __init__(self, whose: str) -> None:
        self._whose = whose
        self._changed = threading.Condition()
        self._waiting: Delivery | None = None  # brought by an input, not yet taken
        self._taken: Delivery | None = None  # being read
        self._open = True
        self._interruptions = 0  # a reader is woken by one that is over before it has its turn

    def bring(self, delivery: Delivery) -> None:
        """Wait until somebody has read this message, or the port is interrupted. In the thread of an input."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting is None or not self._open)
            if not self._open:
                return
            self._waiting = delivery
            self._changed.notify_all()
            # Who has begun to read is waited for, even when the port is interrupted: the data are in its hands.
            self._changed.wait_for(lambda: self._taken is not delivery and not self._pending(delivery))
            if self._waiting is delivery:
                self._waiting = None

    def _pending(self, delivery: Delivery) -> bool:
        return self._waiting is delivery and self._open

    @contextmanager
    def take(self, timeout: float | None) -> Iterator[Delivery]:
        """The next message; its sender waits until the block is left. One reader at a time.

        Raises WaitTimeoutError, and PortClosedError when the port is interrupted or closed.
        """
        deadline = clock.Deadline.after(timeout)
        with self._changed:
            before = self._interruptions
            while self._waiting is None or self._taken is not None:
                if not self._open or self._interruptions > before:
                    raise PortClosedError(f"{self._whose} was interrupted while it was read")
                if deadline.expired:
                    raise WaitTimeoutError(f"nothing came to {self._whose} within {timeout:g} s")
                self._changed.wait(None if timeout is None else deadline.remaining())
            delivery = self._taken = self._waiting
            self._waiting = None
        try:
            yield delivery
        finally:
            with self._changed:
                self._taken = None
                self._changed.notify_all()

    def set_open(self, *, is_open: bool) -> None:
        """Wake everybody, and let messages pass unread until it is open again."""
        with self._changed:
            self._open = is_open
            self._interruptions += not is_open
            self._changed.notify_all()
