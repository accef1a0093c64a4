"""The one door to time: what the hour is, how long something took, when it must end.

Nobody else imports :mod:`time`. Today the door opens on the system clock; network time and lockstep with a simulator
enter here too.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

#: What must be added to the monotonic clock to get seconds since 1970, read once. Wall time therefore never jumps
#: within a process, and children forked from it agree with it to the last bit.
_WALL_OFFSET = time.time() - time.monotonic()

FOREVER = float("inf")


def monotonic() -> float:
    """Seconds that never go backwards, the same for all processes of this machine."""
    return time.monotonic()


def now() -> float:
    """Seconds since 1970-01-01 UTC, never going backwards within one process and its forks."""
    return time.monotonic() + _WALL_OFFSET


def sleep(seconds: float) -> None:
    """Wait for ``seconds``; nothing happens for zero or less."""
    if seconds > 0:
        time.sleep(seconds)


def iso(wall: float, *, milliseconds: bool = True) -> str:
    """Write wall-clock seconds as ISO 8601 in UTC, such as ``2026-11-21T02:34:32.120Z``."""
    whole = int(wall // 1)
    text = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(whole))
    return f"{text}.{int((wall - whole) * 1000):03d}Z" if milliseconds else f"{text}Z"


def local_stamp(wall: float) -> str:
    """Write wall-clock seconds as a sortable local stamp for file names, such as ``20261121-023432``."""
    return time.strftime("%Y%m%d-%H%M%S", time.localtime(wall))


@dataclass(frozen=True, slots=True)
class Deadline:
    """A moment on the monotonic clock by which something must have ended; handed down instead of numbers of seconds."""

    at: float = FOREVER
    limit: float = FOREVER

    @classmethod
    def after(cls, seconds: float | None) -> Deadline:
        """Make the deadline ``seconds`` from now; None means never."""
        if seconds is None or seconds == FOREVER:
            return cls()
        return cls(monotonic() + seconds, seconds)

    def remaining(self) -> float:
        """Seconds left, never negative, ``inf`` when there is no limit."""
        return max(0.0, self.at - monotonic())

    @property
    def expired(self) -> bool:
        """Whether the moment has passed."""
        return self.at <= monotonic()

    def earliest(self, other: Deadline) -> Deadline:
        """The one of two deadlines that comes first."""
        return self if self.at <= other.at else other
