"""Updates of the feed from the journal: on notification by the runner, while clients follow it, at a limited rate."""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import os
from typing import TYPE_CHECKING

from rtf.page.journal_feed import Feed

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

#: The least seconds between two updates, and the addition for each client, as new lines are sent to all of them.
PAUSE = 0.03
_PAUSE_PER_CLIENT = 0.001
#: Seconds after which the feed is updated without a notification: with a notifying runner, and without one.
_LOOK = 0.5
_BLIND_LOOK = 0.1


class Watch:
    """Keeps a feed up to date. ``notifier`` is the eventfd of the runner; None if there is none."""

    def __init__(self, path: Path, notifier: int | None) -> None:
        self.feed = Feed(path, self._update)
        self._notifier = notifier
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None

    def _update(self) -> None:
        """Update the feed now, wake the streams, and wait for notifications after a pause."""
        if self._notifier is not None:
            self._loop.remove_reader(self._notifier)
            with contextlib.suppress(BlockingIOError):
                os.eventfd_read(self._notifier)
        if self.feed.grow():
            self.feed.announce()
        self._later(PAUSE + _PAUSE_PER_CLIENT * self.feed.followers, self._wait)

    def _wait(self) -> None:
        """Wait for a notification, unless there are no clients."""
        if not self.feed.followers:
            return
        self._later(_BLIND_LOOK if self._notifier is None else _LOOK, self._update)
        if self._notifier is not None:
            self._loop.add_reader(self._notifier, self._update)

    def _later(self, seconds: float, then: Callable[[], None]) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._loop.call_later(seconds, then)

    def finish(self) -> None:
        """Read the rest of the complete journal."""
        self.feed.grow()
        self.feed.over = True
        self.feed.announce()


def is_written(journal: Path) -> bool:
    """Return whether a runner has locked the journal for writing."""
    with journal.open("rb") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        except OSError:  # a file system without locks
            return False
    return False
