"""Time: the current time, durations and deadlines.

No other module imports :mod:`time`. The functions use the machine's own clock, for supervision, timeouts of peers and
records. Code that moves and measures a robot uses :func:`current`, which may be the network's clock or a simulator's
(:mod:`rtf.middleware.clocks.network_clock`).
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

#: The offset from the monotonic clock to seconds since 1970, read once. Wall time therefore never jumps within a
#: process, and forked children agree with it to the last bit.
_WALL_OFFSET = time.time() - time.monotonic()

FOREVER = float("inf")
#: The units of durations, the longer names before those that they end with.
_UNITS = {"ms": 0.001, "min": 60.0, "s": 1.0, "h": 3600.0}


def monotonic() -> float:
    """Return seconds that never go backwards, the same for all processes of this machine."""
    return time.monotonic()


def now() -> float:
    """Return seconds since 1970-01-01 UTC, never going backwards within one process and its forks."""
    return time.monotonic() + _WALL_OFFSET


def sleep(seconds: float) -> None:
    """Wait for ``seconds``; zero or less returns at once."""
    if seconds > 0:
        time.sleep(seconds)


def iso(wall: float, *, milliseconds: bool = True) -> str:
    """Return wall-clock seconds as ISO 8601 in UTC, such as ``2026-11-21T02:34:32.120Z``."""
    whole = int(wall // 1)
    text = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(whole))
    return f"{text}.{int((wall - whole) * 1000):03d}Z" if milliseconds else f"{text}Z"


def local_stamp(wall: float) -> str:
    """Return wall-clock seconds as a sortable local stamp for file names, such as ``20261121-023432``."""
    return time.strftime("%Y%m%d-%H%M%S", time.localtime(wall))


def read_duration(text: str) -> float:
    """Return the seconds of a duration such as ``20``, ``500ms``, ``2min`` or ``1h``. Raises ValueError."""
    number, factor = text.strip(), 1.0
    for name, value in _UNITS.items():
        if number.endswith(name):
            number, factor = number[: -len(name)], value
            break
    try:
        duration = float(number) * factor
    except ValueError:
        raise ValueError(f"{text!r} is no duration; write seconds, or 500ms, 2min, 1h") from None
    if not 0 < duration < FOREVER:
        raise ValueError(f"a duration must be positive, not {text}")
    return duration


@dataclass(frozen=True, slots=True)
class Deadline:
    """A time limit on the monotonic clock; passed down instead of numbers of seconds."""

    at: float = FOREVER
    limit: float = FOREVER

    @classmethod
    def after(cls, seconds: float | None) -> Deadline:
        """Return the deadline ``seconds`` from now; None means never."""
        if seconds is None or seconds == FOREVER:
            return cls()
        return cls(monotonic() + seconds, seconds)

    def remaining(self) -> float:
        """Return the seconds left, never negative, ``inf`` without a limit."""
        return max(0.0, self.at - monotonic())

    @property
    def expired(self) -> bool:
        """Whether the deadline has passed."""
        return self.at <= monotonic()

    def earliest(self, other: Deadline) -> Deadline:
        """Return the earlier of two deadlines."""
        return self if self.at <= other.at else other


class Clock(ABC):
    """The clock of a robot: the machine's, or a simulator's.

    All methods may be called from any thread.
    """

    @abstractmethod
    def now(self) -> float:
        """Return seconds since this clock's epoch, which for the machine's own is 1970."""

    @abstractmethod
    def sleep(self, seconds: float) -> None:
        """Wait for ``seconds`` of this clock; zero or less returns at once."""

    def taking_part(self, name: str) -> AbstractContextManager[object]:  # noqa: ARG002 - for clocks in lockstep
        """Return a context in whose thread a time in lockstep passes only while the thread sleeps.

        The time stands still from this call on, so the thread of the context may be started after it. ``name`` is for
        messages.
        """
        return nullcontext()

    def close(self) -> None:  # noqa: B027 - most clocks hold no resources
        """Release the resources of the clock. A second call has no effect."""


class SystemClock(Clock):
    """The machine's own time."""

    def now(self) -> float:
        return now()

    def sleep(self, seconds: float) -> None:
        sleep(seconds)


_current: list[Clock] = [SystemClock()]


def current() -> Clock:
    """Return the clock of this process's robot; the machine's own unless :func:`use` has set another one."""
    return _current[-1]


@contextmanager
def use(chosen: Clock) -> Iterator[Clock]:
    """Use a clock as the robot's within the block, and close it at the end."""
    _current.append(chosen)
    try:
        yield chosen
    finally:
        _current.remove(chosen)
        chosen.close()
