"""What devices are asked to do, in threads of their own, so that one that hangs or throws takes nobody with it."""

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
    """How many seconds devices have before they are taken for hanging.

    ``action`` is for those that do not move the robot, ``move`` for those that do; an action may say otherwise.
    ``abort`` is for a calibrator to hear that it shall stop, ``grace`` for what it does to end then, and ``hurry`` for
    what does not move the robot once the end has been asked for twice.
    """

    open: float = 60.0
    close: float = 15.0
    action: float = 30.0
    move: float = 300.0
    abort: float = 2.0
    grace: float = 5.0
    hurry: float = 2.0


class StopRequests:
    """How often the end was asked for. Everybody waits here, so that such a request is heard at once. Any thread."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._count = 0

    @property
    def count(self) -> int:
        """How often so far."""
        return self._count

    def add(self, *, first_only: bool = False) -> None:
        """Ask for the end, or with ``first_only`` only if nobody has."""
        with self._changed:
            if not (first_only and self._count):
                self._count += 1
            self._changed.notify_all()

    def notify(self) -> None:
        """Have those who wait look again."""
        with self._changed:
            self._changed.notify_all()

    def wait(self, over: Callable[[], bool], deadline: Deadline) -> None:
        """Wait until something is so, or the time is up."""
        remaining = deadline.remaining()
        with self._changed:
            self._changed.wait_for(over, None if remaining == clock.FOREVER else remaining)


class Task:
    """One thing that a device is asked to do: its name, whether it is done, how long it took, what it raised."""

    def __init__(self, name: str, job: Callable[[], object], stop_requests: StopRequests) -> None:
        self.name = name
        self.error: BaseException | None = None
        self.done = False
        self.began = clock.monotonic()
        self.duration = 0.0
        self._job = job
        self._stop_requests = stop_requests

    def run(self) -> None:
        """Do it, in this thread."""
        try:
            self._job()
        except BaseException as error:  # noqa: BLE001 - whatever a device raises is its own, a SystemExit as well
            self.error = error
        self.duration = clock.monotonic() - self.began
        self.done = True
        self._stop_requests.notify()

    def start(self) -> Task:
        """Do it in a thread of its own."""
        threading.Thread(target=self.run, name=f"rtf-{self.name}", daemon=True).start()
        return self


class DeviceThread:
    """The thread in which a device is opened, attached, detached and closed, one after the other."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._tasks: queue.SimpleQueue[Task | None] = queue.SimpleQueue()
        self._last: Task | None = None
        self._thread: threading.Thread | None = None

    @property
    def busy_with(self) -> Task | None:
        """What it has not done yet."""
        return None if self._last is None or self._last.done else self._last

    def submit(self, task: Task) -> Task:
        """Have it do something when it has done the rest."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._work, name=f"rtf-device-{self._name}", daemon=True)
            self._thread.start()
        self._last = task
        self._tasks.put(task)
        return task

    def end(self) -> None:
        """There is nothing more to do. Returns at once; the thread ends when it has done the rest."""
        self._tasks.put(None)

    def _work(self) -> None:
        while (task := self._tasks.get()) is not None:
            task.run()


def sentence_of(error: BaseException) -> str:
    """What an error says, with its kind where that is not one of ours, and not without end."""
    from rtf.errors import RtfError

    text = str(error) if isinstance(error, RtfError) else f"{type(error).__name__}: {error}"
    return text[:_LONGEST]


_LONGEST = 2000
