"""Sends in the background: a thread for each output of a buffered port, and at most one message on its way in each."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from rtf.middleware.errors import MiddlewareError

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.outgoing import Outgoing
    from rtf.middleware.outputs import Output


class Sender:
    """The thread of one output. ``failed`` is called in it when the connection broke; then it ends."""

    def __init__(self, output: Output, failed: Callable[[Output, MiddlewareError], None]) -> None:
        self.output = output
        self.skipped = 0
        self._failed = failed
        self._changed = threading.Condition()
        self._message: Outgoing | None = None
        self._open = True
        self._thread = threading.Thread(target=self._run, name=f"rtf-sender {output.peer}", daemon=True)
        self._thread.start()

    def offer(self, message: Outgoing, *, patiently: bool = False) -> bool:
        """Send a message, unless the one before is still on its way; then skip it, or ``patiently`` wait."""
        with self._changed:
            if patiently:  # here, since several may write at the same time
                self._changed.wait_for(lambda: self._message is None or not self._open)
            if self._message is not None or not self._open:
                self.skipped += 1
                return False
            self._message = message
            self._changed.notify_all()
            return True

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until nothing is on its way; False when that takes too long."""
        with self._changed:
            return self._changed.wait_for(lambda: self._message is None or not self._open, timeout)

    def close(self) -> None:
        """End the thread when it is done with what it has. The connection is somebody else's to close."""
        with self._changed:
            self._open = False
            self._changed.notify_all()

    def join(self, timeout: float) -> None:
        """Wait for the thread to end."""
        if self._thread is not threading.current_thread():
            self._thread.join(timeout)

    def _run(self) -> None:
        self.output.thread = threading.get_native_id()
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._message is not None or not self._open)
                message = self._message
                if message is None:
                    return
            try:
                with self.output.lock:
                    self.output.link.send(message)
                    self.output.link.finish()
            except MiddlewareError as error:
                self.close()
                self._failed(self.output, error)
            finally:
                with self._changed:
                    self._message = None
                    self._changed.notify_all()
