"""Requests to stop a run: how strong they are, who made them, and until when the run has to end."""

from __future__ import annotations

import signal
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rtf import clock
from rtf.testing.events import Event, Interrupted
from rtf.testing.isolation import processes
from rtf.testing.isolation.messages import STOP_LIMIT

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.testing.isolation.reactor import Reactor


#: The stage at which nothing is waited for any more.
KILL_STAGE = 3
_NOW_STAGE = 2
#: Seconds that the running test, with its teardown, has to end after SIGTERM or SIGHUP. The fixtures come after it, and
#: the reports, before the sender kills, which is ten seconds later as a rule.
TEST_LIMIT = 2.5


class Interrupts:
    """How strongly the run has been asked to stop: 0 not at all, 1 after the running test, 2 now, 3 by force.

    ``test_deadline`` is the moment at which the running test is killed, since a signal asked the run to end at once.

    Safe to raise from a signal handler or any thread; each suite worker notices at its next turn.
    """

    def __init__(self) -> None:
        self.stage = 0
        self.test_deadline = clock.Deadline()
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

    def signalled(self, signum: int) -> None:
        """Note a signal. SIGINT asks for one stage more; SIGTERM and SIGHUP ask the run to end at once, and in time."""
        if signum == signal.SIGINT:
            self.request(processes.signal_name(signum))
            return
        if not self.in_a_hurry:
            self.test_deadline = clock.Deadline.after(TEST_LIMIT)
        self.request(processes.signal_name(signum), stage=0 if self.stage >= _NOW_STAGE else _NOW_STAGE)

    @property
    def in_a_hurry(self) -> bool:
        """Whether the run has to end at once, and in time."""
        return self.test_deadline.at != clock.FOREVER

    def fixtures_deadline(self, more: float) -> clock.Deadline:
        """When fixtures are killed that have not come down; ``more`` is what some need beyond the limit, in seconds."""
        limit = STOP_LIMIT + more
        return clock.Deadline(self.test_deadline.at + limit, TEST_LIMIT + limit)

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
