"""Periodic publishing: by threads that follow the robot's clock, or by a simulation at its own times."""

from __future__ import annotations

import threading
from abc import abstractmethod
from typing import TYPE_CHECKING, Any, Protocol

from rtf import clock

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.middleware.ports.network import Network
    from rtf.middleware.ports.outputs import Output
    from rtf.middleware.types.codecs import Codec


class Outlet(Protocol):
    """A port through which a server sends a stream."""

    @property
    def outputs(self) -> Sequence[Output]:
        """The connected readers."""

    def write(self, value: Any, *, envelope: str) -> object:  # Any: an object of the codec that it was opened with
        """Send an object with its stamp. It may be changed afterwards, except while a ``local`` reader uses it."""

    def settle(self, timeout: float | None = None) -> bool:
        """Wait until all readers have received it; False after ``timeout`` s of real time."""

    def close(self) -> None:
        """Close the port."""


class Outlets(Protocol):
    """A factory of outlets."""

    def open(self, name: str, codec: Codec[Any], network: Network) -> Outlet:
        """Open a port for objects of a codec. Raises the middleware's errors."""


class Publisher(Protocol):
    """Something that is published every ``period`` seconds, by a thread or by a simulator's loop."""

    period: float

    def publish(self, now: float) -> None:
        """Publish the data at ``now``, in seconds of the robot's clock."""


class PublishingClock(clock.Clock):
    """The clock of a simulation of this process, which calls publishers itself, in its thread, at exact times.

    ``outlets`` opens the ports of their streams: what they send at a time is delivered before it has passed.
    """

    outlets: Outlets

    @abstractmethod
    def publish_regularly(self, publisher: Publisher) -> Callable[[], None]:
        """Call a publisher every period. Return what ends that: then no call is in progress."""


class PeriodicPublishing:
    """Calls a publisher until it is stopped: by the robot's clock if that publishes, else in a thread of its own.

    A missed period is skipped. An error ends the work of its period only; it is passed to ``report``, the same message
    once.
    """

    def __init__(self, publisher: Publisher, *, name: str, report: Callable[[str], None]) -> None:
        self.period = publisher.period
        self.publisher = publisher
        self._report = report
        self._reported = ""
        self._ended = threading.Event()
        time = clock.current()
        self._leave = time.publish_regularly(self) if isinstance(time, PublishingClock) else self._start(name)

    def _start(self, name: str) -> Callable[[], None]:
        thread = threading.Thread(target=self._run, name=f"rtf-periodic {name}", daemon=True)
        thread.start()

        def leave() -> None:
            if thread is not threading.current_thread():
                thread.join()

        return leave

    def _run(self) -> None:
        time = clock.current()
        due = time.now()
        while not self._ended.is_set():
            self.publish(time.now())
            due = max(due + self.period, time.now())
            self._wait_until(due, time)

    def _wait_until(self, due: float, time: clock.Clock) -> None:
        """Wait. By the machine's clock ``stop`` ends the wait at once, by others it lasts for the period."""
        if isinstance(time, clock.SystemClock):
            self._ended.wait(max(0.0, due - time.now()))
        else:
            time.sleep(due - time.now())

    def publish(self, now: float) -> None:
        """Publish, and report an error."""
        try:
            self.publisher.publish(now)
        except Exception as error:  # noqa: BLE001 - the next period may succeed, and the error is reported
            sentence = f"{type(error).__name__}: {error}"
            if sentence != self._reported:
                self._reported = sentence
                self._report(sentence)

    def stop(self) -> None:
        """Stop. When it returns, no call is in progress, unless the publisher itself stops it."""
        self._ended.set()
        self._leave()
