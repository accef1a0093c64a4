"""The handoff of messages from input threads to a reader: the sender waits until its message has been read."""

from __future__ import annotations

import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rtf import clock
from rtf.middleware.errors import PortClosedError, WaitTimeoutError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.wire.incoming_message import IncomingMessage


class MessageHandoff:
    """Passes messages to readers one at a time. ``whose`` is the port's name, for errors."""

    def __init__(self, whose: str) -> None:
        self._whose = whose
        self._changed = threading.Condition()
        self._waiting: IncomingMessage | None = None  # offered by an input, not yet taken
        self._taken: IncomingMessage | None = None  # being read
        self._open = True
        self._interruptions = 0  # a reader notices one that is over before the reader runs

    def offer(self, delivery: IncomingMessage) -> None:
        """Wait until a reader has read this message, or the port is interrupted. Runs in the thread of an input."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting is None or not self._open)
            if not self._open:
                return
            self._waiting = delivery
            self._changed.notify_all()
            # A reader that has started is awaited even when the port is interrupted: it uses the data.
            self._changed.wait_for(lambda: self._taken is not delivery and not self._pending(delivery))
            if self._waiting is delivery:
                self._waiting = None

    def _pending(self, delivery: IncomingMessage) -> bool:
        return self._waiting is delivery and self._open

    @contextmanager
    def take(self, timeout: float | None) -> Iterator[IncomingMessage]:
        """Take the next message; its sender waits until the block is left. One reader at a time.

        Raises WaitTimeoutError, and PortClosedError when the port is interrupted or closed.
        """
        deadline = clock.Deadline.after(timeout)
        with self._changed:
            before = self._interruptions
            while self._waiting is None or self._taken is not None:
                if not self._open or self._interruptions > before:
                    raise PortClosedError(f"{self._whose} was interrupted while it was read")
                if deadline.expired:
                    raise WaitTimeoutError(f"no message arrived at {self._whose} within {timeout:g} s")
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
        """Wake all threads. While not open, messages are discarded unread."""
        with self._changed:
            self._open = is_open
            self._interruptions += not is_open
            self._changed.notify_all()
