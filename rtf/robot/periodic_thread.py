"""Periodic publishing, by the robot's clock."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Protocol

from rtf import clock

if TYPE_CHECKING:
    from collections.abc import Callable


class Publisher(Protocol):
    """Something that is published every ``period`` seconds, by a thread or by a simulator's loop."""

    period: float

    def publish(self, now: float) -> None:
        """Publish the data at ``now``, in seconds of the robot's clock."""


class PeriodicThread:
    """Calls a publisher in a thread of its own until it is stopped.

    A missed period is skipped. An error ends the work of its period only; it is passed to ``report``, the same message
    once.
    """

    def __init__(self, publisher: Publisher, *, name: str, report: Callable[[str], None]) -> None:
        self._publisher = publisher
        self._report = report
        self._ended = threading.Event()
        self._said = ""
        self._thread = threading.Thread(target=self._run, name=f"rtf-periodic {name}", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        time = clock.current()
        due = time.now()
        while not self._ended.is_set():
            self._publish(time.now())
            due = max(due + self._publisher.period, time.now())
            self._wait_until(due, time)

    def _wait_until(self, due: float, time: clock.Clock) -> None:
        """Wait. By the machine's clock ``stop`` ends the wait at once, by others it lasts for the period."""
        if isinstance(time, clock.SystemClock):
            self._ended.wait(max(0.0, due - time.now()))
        else:
            time.sleep(due - time.now())

    def _publish(self, now: float) -> None:
        try:
            self._publisher.publish(now)
        except Exception as error:  # noqa: BLE001 - the next period may succeed, and the error is reported
            sentence = f"{type(error).__name__}: {error}"
            if sentence != self._said:
                self._said = sentence
                self._report(sentence)

    def stop(self) -> None:
        """Stop and join the thread. The publishing thread may call it, too."""
        self._ended.set()
        if self._thread is not threading.current_thread():
            self._thread.join()
