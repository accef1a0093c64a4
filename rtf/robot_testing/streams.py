"""What a stream of messages was like: its rate, its gaps, what was lost, repeated or late."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot_testing.statistics import Periods, periods_of, surely_beyond

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.listening import Message


class Stream(NamedTuple):
    """The facts about the messages of a window of time. Times in s, in the order of the stamps.

    ``messages`` are those that came, each number once; ``duplicates`` came again, ``lost`` are missing among their
    numbers, and ``overtaken`` came behind a later one. ``every`` is k where only each k-th number came, else 0.
    ``delays`` are arrival less stamp, NaN without stamps; they contain what the clocks of two machines differ by.
    """

    messages: tuple[Message, ...]
    periods: Periods
    duplicates: int
    lost: int
    overtaken: int
    every: int
    delays: FloatArray

    @property
    def times(self) -> FloatArray:
        """The moments of the messages."""
        return np.array([message.moment for message in self.messages])

    @property
    def loss(self) -> float:
        """The share of messages that are missing, in per cent of those that were sent."""
        return 100.0 * self.lost / (self.lost + len(self.messages))

    def jitter(self, share: float) -> float:
        """By how much later than the quickest message such a share of all came at most."""
        return float(np.quantile(self.delays, share) - self.delays.min())

    def sure_jitter(self, share: float) -> float:
        """What that surely is at least, for a stream that goes on like this: no more than the statistics allow."""
        return surely_beyond(self.delays, share) - float(self.delays.min())


def within(messages: Sequence[Message], skipped: float, seconds: float) -> list[Message]:
    """The messages of ``seconds`` after the first ``skipped`` ones, by the sender's time, in the order of arrival."""
    if not messages:
        return []
    begin = min(message.moment for message in messages) + skipped
    return [message for message in messages if begin <= message.moment < begin + seconds]


def stream_of(messages: Sequence[Message]) -> Stream:
    """The facts. ValueError for fewer than three different messages."""
    counts = [message.number for message in messages]
    counted = all(count >= 0 for count in counts)
    once = {message.number: message for message in reversed(messages)} if counted else dict(enumerate(messages))
    ordered = tuple(once[count] for count in sorted(once))
    numbers = np.array(sorted(once))
    gaps = np.diff(numbers)
    return Stream(
        messages=ordered,
        periods=periods_of([message.moment for message in ordered]),
        duplicates=len(messages) - len(ordered),
        lost=int((gaps - 1).sum()) if counted else 0,
        overtaken=int(sum(later < before for before, later in pairwise(counts))),
        every=int(gaps[0]) if gaps.size and gaps[0] > 1 and (gaps == gaps[0]).all() else 0,
        delays=np.array([message.arrival - message.time for message in ordered]),
    )
