"""Work that a name server does beside answering: one thread, and a bounded queue in front of it."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from rtf.errors import RtfError

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable

MAX_WAITING = 4096


class Errands:
    """Does one thing after the other. Its thread begins with the first errand and ends with ``close``.

    ``failed`` is called, in it, with the error of an errand. When too much waits, the oldest is not done.
    """

    def __init__(self, name: str, failed: Callable[[RtfError], None]) -> None:
        self._name = name
        self._failed = failed
        self._changed = threading.Condition()
        self._waiting: dict[Hashable, Callable[[], None]] = {}
        self._thread: threading.Thread | None = None
        self._open = True

    def put(self, key: Hashable, errand: Callable[[], None]) -> None:
        """Do this when all before it is done; one of the same key that still waits is replaced."""
        with self._changed:
            if not self._open:
                return
            self._waiting.pop(key, None)
            self._waiting[key] = errand
            if len(self._waiting) > MAX_WAITING:
                del self._waiting[next(iter(self._waiting))]
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
                self._thread.start()
            self._changed.notify_all()

    def cancel(self, key: Hashable) -> None:
        """Do not do what waits under this key."""
        with self._changed:
            self._waiting.pop(key, None)

    def close(self) -> None:
        """Do nothing more; waits for what is being done."""
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
                if self._open:  # a bug ends the thread, and is heard of; the next errand gets another one
                    self._thread = None

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or not self._open)
                if not self._open:
                    return
                errand = self._waiting.pop(next(iter(self._waiting)))
            try:
                errand()
            except RtfError as error:
                self._failed(error)
