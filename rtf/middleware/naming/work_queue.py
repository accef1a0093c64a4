"""A queue of tasks that a name server executes in the background: one thread, and a bounded number of waiting tasks."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from rtf.errors import RtfError

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable

MAX_WAITING = 4096


class WorkQueue:
    """Executes tasks in order. Its thread starts with the first task and ends with ``close``.

    ``failed`` is called in that thread with the error of a task. When the queue is full, the oldest task is dropped.
    """

    def __init__(self, name: str, failed: Callable[[RtfError], None]) -> None:
        self._name = name
        self._failed = failed
        self._changed = threading.Condition()
        self._waiting: dict[Hashable, Callable[[], None]] = {}
        self._thread: threading.Thread | None = None
        self._open = True

    def put(self, key: Hashable, task: Callable[[], None]) -> None:
        """Append a task. It replaces a waiting task with the same key."""
        with self._changed:
            if not self._open:
                return
            self._waiting.pop(key, None)
            self._waiting[key] = task
            if len(self._waiting) > MAX_WAITING:
                del self._waiting[next(iter(self._waiting))]
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
                self._thread.start()
            self._changed.notify_all()

    def cancel(self, key: Hashable) -> None:
        """Remove the waiting task with this key."""
        with self._changed:
            self._waiting.pop(key, None)

    def close(self) -> None:
        """Discard the waiting tasks, and wait for the running one."""
        with self._changed:
            self._open = False
            self._waiting.clear()
            self._changed.notify_all()
            thread = self._thread
        if thread is not None:
            thread.join()

    def _run(self) -> None:
        try:
            self._work()
        finally:
            with self._changed:
                if self._open:  # an unexpected error ends the thread and is reported; the next task starts another one
                    self._thread = None

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or not self._open)
                if not self._open:
                    return
                task = self._waiting.pop(next(iter(self._waiting)))
            try:
                task()
            except RtfError as error:
                self._failed(error)
