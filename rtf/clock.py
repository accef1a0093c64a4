"""The one door to time: what the hour is, how long something took, when it must end.

Nobody else imports :mod:`time`. The functions go by the machine's own clock: what supervises, waits for peers and keeps
records does. What moves and measures a robot goes by :func:`current`, which may be the network's clock or a simulator's
(:mod:`rtf.middleware.time`).
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

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


class Clock(ABC):
    """The time that a robot lives in: the machine's, or that of a simulator.

    All may be called from any thread.
    """

    @abstractmethod
    def now(self) -> float:
        """Seconds since this clock's beginning, which for the machine's own is 1970."""

    @abstractmethod
    def sleep(self, seconds: float) -> None:
        """Wait until the clock is so much later; nothing happens for zero or less."""

    def close(self) -> None:  # noqa: B027 - a clock that needs nothing gives nothing back
        """Give back what the clock needed. Doing so again changes nothing."""


class SystemClock(Clock):
    """The machine's own time."""

    def now(self) -> float:
        return now()

    def sleep(self, seconds: float) -> None:
        sleep(seconds)


_current: list[Clock] = [SystemClock()]


def current() -> Clock:
    """The clock of the robot that this process works with; the machine's own until :func:`use` says otherwise."""
    return _current[-1]


@contextmanager
def use(chosen: Clock) -> Iterator[Clock]:
    """Make a clock the robot's within the block; it is closed at its end."""
    _current.append(chosen)
    try:
        yield chosen
    finally:
        _current.remove(chosen)
        chosen.close()
