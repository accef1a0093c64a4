"""What tests of streams have in common: whom to listen to, for how long, and how a stream is judged."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rtf.bottle import Bottle
from rtf.clock import SystemClock
from rtf.errors import RtfError
from rtf.robot_testing.case import RobotTest
from rtf.robot_testing.causes import likely_causes
from rtf.robot_testing.judging import Judged, judge_values
from rtf.robot_testing.lateness import busyness
from rtf.robot_testing.listening import Listener
from rtf.robot_testing.streams import Stream, stream_of, within
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Value
    from rtf.robot_testing.listening import Message

#: How much longer is listened than is judged, s: late messages of the window must not count as lost.
_GRACE = 0.3
_FEWEST = 3
#: The share of messages that jitter is judged by: a single hiccup of a loaded machine, which is not real time, delays
#: one or two of a hundred. What counts is what that share surely has: two hundred messages can be unlucky.
_JUDGED = 0.9
_BINS = 50
#: How late a thread of this process may run on a machine that is loaded and not real time, ms.
_SCHEDULING = 20.0


class StreamTest(RobotTest):
    """A test that listens. Windows are by the sender's stamps, so that neither the way nor the reader shortens them."""

    warm_up = Parameter(float, "time after the first message that is not judged", unit="s", default=0.2, low=0.0)

    def setup(self) -> None:
        """Find the robot, and prepare to listen."""
        super().setup()
        self.listener = Listener(self.network, self.clock)
        self.add_cleanup(self.listener.close)

    def known_ports(self, *endings: str) -> list[str]:
        """The ports of the robot that the name server knows and that end like this."""
        names = [contact.name for contact in self.network.names.list(f"/{self.robot_name}")]
        return [name for name in names if name.endswith(endings)]

    def listen(self, seconds: float, *, arrivals: bool = True) -> None:
        """Listen for so long, the warm-up and the grace not counted; without ``arrivals`` these are known roughly."""
        self.listener.listen(self.warm_up + seconds + _GRACE, arrivals=arrivals)

    def judged(self, messages: Sequence[Message], seconds: float, name: str) -> list[Message]:
        """The messages of the window. Fails where there are too few to say anything of them, or all have one stamp."""
        found = within(messages, self.warm_up, seconds)
        latest = found or messages[len(messages) // 2 :]  # behind stamps that stand still there is no window
        stands = len({one.number for one in latest}) >= _FEWEST and len({one.moment for one in latest}) == 1
        self.assert_fail_if_true(stands, f"the stamps of {name} do not advance: {len(latest)} messages have the same")
        self.assert_true(
            len({message.number for message in found} if found and found[0].number >= 0 else found) >= _FEWEST,
            f"{len(messages)} messages came in {self.warm_up + seconds + _GRACE:g} s; "
            f"{_FEWEST} are needed to say anything",
        )
        return found

    @staticmethod
    def lines(group: Bottle) -> list[list[Value]]:
        """The lines of a section such as ``[PORTS]``; its lists may stand in another list, as in a suite."""
        first = group.get(0)
        rows = first if len(group) == 1 and isinstance(first, Bottle) and isinstance(first.get(0), Bottle) else group
        return [[*row] if isinstance(row, Bottle) else [row] for row in rows]

    def open_stream(self, name: str, *, optional: bool = False, keep: bool = False) -> bool:
        """Listen to a port as well; whether it is there. A missing one fails in a sub-result, unless it is optional."""
        try:
            self.listener.add(name, keep=keep)
        except RtfError as error:
            with self.subresult(name):
                if optional:
                    self.skip(f"{name} is not there: {error}")
                self.assert_fail(f"{name} cannot be listened to: {error}")
        return name in self.listener.recorders


class RateTest(StreamTest):
    """A test that judges how streams come, beside what they say."""

    # Senders skip readers that are busy: on a machine that is loaded some messages are missing without a fault.
    max_loss = Parameter(float, "share of messages that may be missing", unit="%", default=5.0, low=0.0, high=100.0)
    max_duplicates = Parameter(int, "messages that may come again", unit="count", default=0, low=0)
    # A tenth of a second at 100 Hz: what reads a stream takes it for broken by then.
    max_gap = Parameter(float, "longest time without a message, in expected periods", default=10.0, low=1.0)
    # A period of 100 Hz and a little; and two, for what goes by way of another machine.
    max_jitter = Parameter(
        float, "by how much later than the quickest message nine of ten may come, surely", unit="ms", default=12.0,
        low=0.0,
    )  # fmt: skip
    max_latency = Parameter(
        float, "how late half of the messages may come, where the clocks are the same", unit="ms", default=20.0, low=0.0
    )

    def judge(self, found: Sequence[Message], rate: float, tolerance: float) -> Stream:
        """Measure rate, losses, duplicates, gaps, jitter and latency of a window, and say what is wrong.

        On a machine that has more to do than it can, of which the sender may be a part, what is late or missing is
        inconclusive.
        """
        stream = stream_of(found)
        periods = stream.periods
        self.measure("rate is known within", periods.rate_interval, "Hz")
        self.measure("median period", periods.median * 1e3, "ms")
        self.measure("deviation of the periods", periods.deviation * 1e3, "ms")
        hint = f"{stream.duplicates} messages came again, with the same number; {likely_causes('duplicate')}"
        self.measure("duplicates", stream.duplicates, "count", high=self.max_duplicates, hint=hint)
        self._plot(stream)
        values = [*self._amounts(stream, rate, tolerance), *self._ways(stream)]
        judge_values(self, "the stream", values, busyness(self.listener.waiting))
        return stream

    def _amounts(self, stream: Stream, rate: float, tolerance: float) -> list[Judged]:
        """How much comes. What went by while this machine stood still says nothing of the robot."""
        periods, stalled = stream.periods, min(1.0, self.listener.stalled / float(np.ptp(stream.times)))
        causes = f"; {likely_causes('slow')}" if periods.rate < rate else ""
        low = (rate - tolerance) * (1.0 - stalled)
        # A sender skips a reader that does not read, for as long as that does not.
        longest = 1e3 * (self.max_gap / rate + max(0.0, *self.listener.late))
        missing = f"{stream.lost} messages are missing among {stream.lost + len(stream.messages)}"
        nothing = f"nothing comes for {periods.longest * 1e3:.1f} ms"
        lost = likely_causes("lost")
        return [
            Judged("time in which this machine stood still", 100.0 * stalled, "%"),
            Judged("rate", periods.rate, "Hz", rate + tolerance, low=low, hint=f"{_rate_text(stream)}{causes}"),
            Judged("longest period", periods.longest * 1e3, "ms", longest, hint=f"{nothing}; {lost}"),
            Judged("lost", stream.loss, "%", self.max_loss + 100.0 * stalled, hint=f"{missing}; {lost}"),
        ]

    def _ways(self, stream: Stream) -> list[Judged]:
        """How late messages come; without stamps nothing is known of it."""
        if np.isnan(stream.delays).any():
            self.report("the messages have no stamps: nothing can be said of how late they come")
            return []
        late = np.array(self.listener.late)
        # How late this process is woken is no property of the stream, nor is how fast simulated time passes.
        factor = max(1.0, self.listener.factor)
        for percent in (90, 99):
            self.measure(f"jitter of {percent} of 100 messages", stream.jitter(percent / 100) * 1e3, "ms")
        scheduling = 0.0 if self.listener.exact else _SCHEDULING
        own_usual, own_worst = (float(np.quantile(late, share)) * 1e3 for share in (0.5, _JUDGED))
        behind = f", and {stream.overtaken} came behind a later one" if stream.overtaken else ""
        jitter = self.max_jitter * factor + 2 * max(0.0, own_worst) + scheduling
        # A robot's stamps are by another machine's clock: the difference of the two looks like latency.
        shared = not isinstance(self.clock, SystemClock)
        latency = self.max_latency * factor + 2 * max(0.0, own_usual) if shared else math.inf
        causes = likely_causes("jitter")
        return [
            Judged(
                "jitter",
                stream.sure_jitter(_JUDGED) * 1e3,
                "ms",
                jitter,
                hint=f"messages come irregularly{behind}; {causes}",
            ),
            Judged(
                "latency",
                float(np.median(stream.delays)) * 1e3,
                "ms",
                latency,
                hint=f"messages come late; {causes}",
            ),
        ]

    def _plot(self, stream: Stream) -> None:
        times = stream.times
        self.record(
            "messages",
            time=(times[1:] - times[0], "s"),
            period=(np.diff(times) * 1e3, "ms"),
            delay=(stream.delays[1:] * 1e3, "ms"),
        )
        counts, edges = np.histogram(np.diff(times) * 1e3, bins=_BINS, range=(0.0, 2e3 * stream.periods.longest or 1.0))
        self.record("histogram of periods", period=((edges[1:] + edges[:-1]) / 2, "ms"), messages=(counts, "count"))


def _rate_text(stream: Stream) -> str:
    if stream.every:
        return f"one of {stream.every} messages comes"
    if stream.lost:
        return "messages are missing"
    return f"they are sent every {stream.periods.median * 1e3:.2f} ms"
