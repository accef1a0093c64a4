"""Doing something again and again, by the robot's clock."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Protocol

from rtf import clock

if TYPE_CHECKING:
    from collections.abc import Callable


class Publisher(Protocol):
    """What is published regularly: every ``period`` seconds, by a thread of its own or by a simulator's loop."""

    period: float

    def publish(self, now: float) -> None:
        """Send what there is at ``now``, seconds of the robot's clock."""


class PeriodicThread:
    """Publishes in a thread of its own until it is stopped.

    A moment that was missed is left out, not made up for. An error ends the thread's work for that moment only and goes
    to ``report``, the same sentence once.
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
        """By the machine's clock the wait can be ended at once; by others it ends with the period."""
        if isinstance(time, clock.SystemClock):
            self._ended.wait(max(0.0, due - time.now()))
        else:
            time.sleep(due - time.now())

    def _publish(self, now: float) -> None:
        try:
            self._publisher.publish(now)
        except Exception as error:  # noqa: BLE001 - whatever it is, the next moment may be better, and it is told
            sentence = f"{type(error).__name__}: {error}"
            if sentence != self._said:
                self._said = sentence
                self._report(sentence)

    def stop(self) -> None:
        """End; returns when the thread is gone. A thread that publishes may stop itself."""
        self._ended.set()
        if self._thread is not threading.current_thread():
            self._thread.join()
