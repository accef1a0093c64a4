"""Calls of devices in threads of their own, so that one that hangs or raises does not affect the others."""

from __future__ import annotations

import queue
import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf import clock

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.clock import Deadline


@dataclass(frozen=True, slots=True)
class Patience:
    """The timeouts in seconds after which a call of a device counts as hanging.

    ``action`` is for actions that do not move the robot, ``move`` for those that do; an action may have its own
    timeout. ``abort`` is for the call of a calibrator's abort, ``grace`` for the end of the movement after it, and
    ``hurry`` for calls that do not move the robot, after the second stop request.
    """

    open: float = 60.0
    close: float = 15.0
    action: float = 30.0
    move: float = 300.0
    abort: float = 2.0
    grace: float = 5.0
    hurry: float = 2.0


class StopRequests:
    """The number of stop requests. All waiting happens here, so that a request is noticed at once. Thread-safe."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._count = 0

    @property
    def count(self) -> int:
        """The number of requests so far."""
        return self._count

    def add(self, *, first_only: bool = False) -> None:
        """Add a stop request; with ``first_only`` only if there is none."""
        with self._changed:
            if not (first_only and self._count):
                self._count += 1
            self._changed.notify_all()

    def notify(self) -> None:
        """Make all waiting threads check their conditions."""
        with self._changed:
            self._changed.notify_all()

    def wait(self, over: Callable[[], bool], deadline: Deadline) -> None:
        """Wait until a condition holds, or the deadline."""
        remaining = deadline.remaining()
        with self._changed:
            self._changed.wait_for(over, None if remaining == clock.FOREVER else remaining)


class Task:
    """A call of a device: its name, whether it is done, how long it took, and what it raised."""

    def __init__(self, name: str, job: Callable[[], object], stop_requests: StopRequests) -> None:
        self.name = name
        self.error: BaseException | None = None
        self.done = False
        self.began = clock.monotonic()
        self.duration = 0.0
        self._job = job
        self._stop_requests = stop_requests

    def run(self) -> None:
        """Run the call in this thread."""
        try:
            self._job()
        except BaseException as error:  # noqa: BLE001 - a device's errors are reported, SystemExit as well
            self.error = error
        self.duration = clock.monotonic() - self.began
        self.done = True
        self._stop_requests.notify()

    def start(self) -> Task:
        """Run the call in a thread of its own."""
        threading.Thread(target=self.run, name=f"rtf-{self.name}", daemon=True).start()
        return self


class DeviceThread:
    """The thread in which a device is opened, attached, detached and closed, in sequence."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._tasks: queue.SimpleQueue[Task | None] = queue.SimpleQueue()
        self._last: Task | None = None
        self._thread: threading.Thread | None = None

    @property
    def busy_with(self) -> Task | None:
        """The last task, if it is not done."""
        return None if self._last is None or self._last.done else self._last

    def submit(self, task: Task) -> Task:
        """Append a task."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._work, name=f"rtf-device-{self._name}", daemon=True)
            self._thread.start()
        self._last = task
        self._tasks.put(task)
        return task

    def end(self) -> None:
        """End the thread after the waiting tasks. Returns at once."""
        self._tasks.put(None)

    def _work(self) -> None:
        while (task := self._tasks.get()) is not None:
            task.run()


def sentence_of(error: BaseException) -> str:
    """Return the message of an error, with its type unless it is an RtfError, shortened to a limit."""
    from rtf.errors import RtfError

    text = str(error) if isinstance(error, RtfError) else f"{type(error).__name__}: {error}"
    return text[:_LONGEST]


_LONGEST = 2000
