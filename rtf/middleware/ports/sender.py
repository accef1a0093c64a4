"""Background sending: one thread per output of a buffered port, with at most one message in transit each."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.ports.outputs import Output
    from rtf.middleware.wire.outgoing_message import OutgoingMessage


class Sender:
    """The sender thread of one output. When the connection fails it calls ``failed`` and ends."""

    def __init__(self, output: Output, failed: Callable[[Output, Exception], None]) -> None:
        self.output = output
        self.skipped = 0
        self._failed = failed
        self._changed = threading.Condition()
        self._message: OutgoingMessage | None = None
        self._open = True
        self._thread = threading.Thread(target=self._run, name=f"rtf-sender {output.peer}", daemon=True)
        self._thread.start()

    def offer(self, message: OutgoingMessage, *, patiently: bool = False) -> bool:
        """Queue a message. If the previous one is in transit, skip this one, or wait if ``patiently``.

        Return whether the message was queued.
        """
        with self._changed:
            if patiently:  # waits here, because several threads may write
                self._changed.wait_for(lambda: self._message is None or not self._open)
            if self._message is not None or not self._open:
                self.skipped += 1
                return False
            self._message = message
            self._changed.notify_all()
            return True

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until no message is in transit. Return False after ``timeout`` seconds."""
        with self._changed:
            return self._changed.wait_for(lambda: self._message is None or not self._open, timeout)

    def close(self) -> None:
        """End the thread after the message in transit. The connection stays open; its owner closes it."""
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
                    sent = self.output.monitored(message)
                    if sent is not None:
                        self.output.link.send(sent)
                        self.output.link.finish()
            except Exception as error:  # noqa: BLE001 - such as one of a local reader's callback; its connection ends
                self.close()
                self._failed(self.output, error)
            finally:
                with self._changed:
                    self._message = None
                    self._changed.notify_all()
