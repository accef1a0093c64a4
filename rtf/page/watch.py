"""When the server looks at the journal: when the runner says so, while somebody follows it, and never too often."""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import os
from typing import TYPE_CHECKING

from rtf.page.feed import Feed

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

#: Seconds between two looks, and what each client adds: what is new is sent to all of them each time.
PAUSE = 0.03
_PAUSE_PER_CLIENT = 0.001
#: Seconds after which a look is taken although nobody said that there is something new, and where nobody ever will.
_LOOK = 0.5
_BLIND_LOOK = 0.1


class Watch:
    """Keeps a feed up to date. ``poke`` is the eventfd of the runner; None where there is none."""

    def __init__(self, path: Path, poke: int | None) -> None:
        self.feed = Feed(path, self._heard)
        self._poke = poke
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None

    def _heard(self) -> None:
        """Look now, tell those who follow, and look again not before the pause is over."""
        if self._poke is not None:
            self._loop.remove_reader(self._poke)
            with contextlib.suppress(BlockingIOError):
                os.eventfd_read(self._poke)
        if self.feed.grow():
            self.feed.announce()
        self._later(PAUSE + _PAUSE_PER_CLIENT * self.feed.followers, self._listen)

    def _listen(self) -> None:
        """Wait for the runner's word; while nobody follows, for nothing."""
        if not self.feed.followers:
            return
        self._later(_BLIND_LOOK if self._poke is None else _LOOK, self._heard)
        if self._poke is not None:
            self._loop.add_reader(self._poke, self._heard)

    def _later(self, seconds: float, then: Callable[[], None]) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._loop.call_later(seconds, then)

    def finish(self) -> None:
        """The journal is complete."""
        self.feed.grow()
        self.feed.over = True
        self.feed.announce()


def is_written(journal: Path) -> bool:
    """Whether a runner holds the journal: it is its one writer as long as it lives."""
    with journal.open("rb") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        except OSError:  # a file system that knows no locks
            return False
    return False
