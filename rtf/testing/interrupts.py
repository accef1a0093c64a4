"""Being asked to stop: how strongly, by whom, and how those who wait hear of it."""

from __future__ import annotations

import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rtf.testing.events import (
    Event,
    Interrupted,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.testing.isolation.reactor import Reactor


#: The stage at which nothing is waited for any more.
KILL_STAGE = 3


class Interrupts:
    """How strongly the run has been asked to stop: 0 not at all, 1 after the running test, 2 now, 3 by force.

    Safe to raise from a signal handler or any thread; each suite worker notices at its next turn.
    """

    def __init__(self) -> None:
        self.stage = 0
        self._requests: list[Interrupted] = []
        self._announced = 0
        self._reactors: list[Reactor] = []
        self._lock = threading.Lock()

    @property
    def count(self) -> int:
        """How often the run has been asked to stop."""
        return len(self._requests)

    def attend(self, reactor: Reactor) -> None:
        """Wake this reactor from now on."""
        self._reactors.append(reactor)

    def leave(self, reactor: Reactor) -> None:
        """Stop waking it."""
        self._reactors.remove(reactor)

    def request(self, source: str, *, stage: int = 0) -> None:
        """Ask for one stage more, or for a stage at least."""
        self.stage = min(KILL_STAGE, max(self.stage + 1 if stage == 0 else self.stage, stage))
        self._requests.append(Interrupted(source=source, stage=self.stage))
        for reactor in [*self._reactors]:
            reactor.wake()

    def announce(self, emit: Callable[[Event], None]) -> None:
        """Tell of what was asked since the last time."""
        with self._lock:
            while self._announced < len(self._requests):
                self._announced += 1
                emit(self._requests[self._announced - 1])


@contextmanager
def alarm(seconds: float | None, ring: Callable[[], None]) -> Iterator[None]:
    """Have ``ring`` called, from a thread of its own, when the body takes longer than ``seconds`` (None: for ever)."""
    if seconds is None:
        yield
        return
    timer = threading.Timer(seconds, ring)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()
