"""Statistics of a message stream: rate, gaps, lost, repeated and late messages."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot_testing.judging.statistics import Periods, periods_of, surely_beyond

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.streams.message import Message


class Stream(NamedTuple):
    """Statistics of the messages of a time window, in the order of their numbers. Times in s.

    ``messages`` has each number once. ``duplicates`` counts repetitions, ``lost`` the missing numbers, ``overtaken``
    the messages that arrived after a later one. ``every`` is k if only every k-th number arrived, else 0. ``delays``
    are arrival time minus stamp, NaN without stamps; they include the offset of the two clocks. ``same_time`` counts
    the messages whose stamps have the time of the message before, ``back_in_time`` those with an earlier one.
    """

    messages: tuple[Message, ...]
    periods: Periods
    duplicates: int
    lost: int
    overtaken: int
    every: int
    delays: FloatArray
    same_time: int
    back_in_time: int

    @property
    def times(self) -> FloatArray:
        """The times of the messages (s)."""
        return np.array([message.moment for message in self.messages])

    @property
    def loss(self) -> float:
        """The share of missing messages, in per cent of those that were sent."""
        return 100.0 * self.lost / (self.lost + len(self.messages))

    def jitter(self, share: float) -> float:
        """Return the quantile ``share`` of the delays behind the quickest message (s)."""
        return float(np.quantile(self.delays, share) - self.delays.min())

    def sure_jitter(self, share: float) -> float:
        """Return the lower confidence bound of ``jitter`` (s)."""
        return surely_beyond(self.delays, share) - float(self.delays.min())


def within(messages: Sequence[Message], skipped: float, seconds: float) -> list[Message]:
    """Return the messages of ``seconds`` after the first ``skipped`` s, by their stamps, in the order of arrival."""
    if not messages:
        return []
    begin = min(message.moment for message in messages) + skipped
    return [message for message in messages if begin <= message.moment < begin + seconds]


def stream_of(messages: Sequence[Message]) -> Stream:
    """Return the statistics of messages. Raises ValueError for fewer than three different ones."""
    counts = [message.number for message in messages]
    counted = all(count >= 0 for count in counts)
    once = {message.number: message for message in reversed(messages)} if counted else dict(enumerate(messages))
    ordered = tuple(once[count] for count in sorted(once))
    numbers = np.array(sorted(once))
    gaps = np.diff(numbers)
    advances = np.diff([message.time for message in ordered])  # NaN without stamps, which counts as neither
    return Stream(
        messages=ordered,
        periods=periods_of([message.moment for message in ordered]),
        duplicates=len(messages) - len(ordered),
        lost=int((gaps - 1).sum()) if counted else 0,
        overtaken=int(sum(later < before for before, later in pairwise(counts))),
        every=int(gaps[0]) if gaps.size and gaps[0] > 1 and (gaps == gaps[0]).all() else 0,
        delays=np.array([message.arrival - message.time for message in ordered]),
        same_time=int((advances == 0.0).sum()),
        back_in_time=int((advances < 0.0).sum()),
    )
