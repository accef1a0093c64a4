"""Base classes of tests of message streams: recording ports, and judging their rate, losses, jitter and latency."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rtf.bottle import Bottle
from rtf.clock import SystemClock
from rtf.errors import RtfError
from rtf.robot_testing.judging.checked_values import CheckedValue, judge_values
from rtf.robot_testing.judging.failure_causes import likely_causes
from rtf.robot_testing.judging.png import png
from rtf.robot_testing.judging.real_time_checks import overload
from rtf.robot_testing.robot_test import RobotTest
from rtf.robot_testing.streams.port_recorder import Listener
from rtf.robot_testing.streams.stream_statistics import Stream, stream_of, within
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rtf.bottle import Value
    from rtf.robot_testing.streams.message import Message

#: Time for which the recording continues after the judged window, s: late messages must not count as lost.
_GRACE = 0.3
_FEWEST = 3
#: The quantile by which jitter is judged: a single stall of a loaded machine without real-time scheduling delays one or
#: two of a hundred messages. Its lower confidence bound counts, as two hundred messages are a small sample.
_JUDGED = 0.9
_BINS = 50
#: Scheduling delay of a thread of this process on a loaded machine without real-time scheduling, ms.
_SCHEDULING = 20.0


class StreamTest(RobotTest):
    """A test that records streams.

    Windows are by the sender's stamps: network and reader delays do not shorten them.
    """

    warm_up = Parameter(float, "time after the first message that is not judged", unit="s", default=0.2, low=0.0)

    def setup(self) -> None:
        """Connect to the robot, and prepare the recording."""
        super().setup()
        self.listener = Listener(self.network, self.clock)
        self.add_cleanup(self.listener.close)

    def known_ports(self, *endings: str) -> list[str]:
        """Return the registered ports of the robot whose names have one of these endings."""
        names = [contact.name for contact in self.network.names.list(f"/{self.robot_name}")]
        return [name for name in names if name.endswith(endings)]

    def attach_picture(self, name: str, pixels: NDArray[np.uint8], what: str = "") -> None:
        """Attach a picture of a stream, grey (height, width) or coloured (height, width, 3), as a file of its name."""
        label = name.strip("/").replace("/", "-")
        self.attach(png(np.ascontiguousarray(pixels)), f"{label}{what}.png", "image/png")

    def listen(self, seconds: float, *, arrivals: bool = True) -> None:
        """Record for ``seconds``, plus warm-up and grace; without ``arrivals`` arrival times are less exact."""
        self.listener.listen(self.warm_up + seconds + _GRACE, arrivals=arrivals)

    def judged(self, messages: Sequence[Message], seconds: float, name: str) -> list[Message]:
        """Return the messages of the window. Fails if there are too few, or if all have one time or one number."""
        found = within(messages, self.warm_up, seconds)
        latest = found or messages[len(messages) // 2 :]  # there is no window if the stamps do not advance
        numbers = {one.number for one in latest}
        stands = len(numbers) >= _FEWEST and len({one.moment for one in latest}) == 1
        self.assert_fail_if_true(stands, f"the stamps of {name} do not advance: {len(latest)} messages have the same")
        same = len(latest) >= _FEWEST > len(numbers) and latest[0].number >= 0
        self.assert_fail_if_true(same, f"{len(latest)} messages of {name} have the number {min(numbers, default=0)}")
        self.assert_true(
            len({message.number for message in found} if found and found[0].number >= 0 else found) >= _FEWEST,
            f"{len(messages)} messages came in {self.warm_up + seconds + _GRACE:g} s; {_FEWEST} are needed",
        )
        return found

    def judge_stamps(self, stream: Stream, repeated: int) -> None:
        """Fail if stamps go back in time, or if more than ``repeated`` messages have the time of the one before."""
        causes = likely_causes("stamps")
        for name, count, most in (
            ("stamps of the same time", stream.same_time, repeated),
            ("stamps that go back in time", stream.back_in_time, 0),
        ):
            hint = f"{count} of {len(stream.messages)} messages, in the order of their numbers; {causes}"
            self.measure(name, count, "count", high=most, hint=hint)

    @staticmethod
    def lines(group: Bottle) -> list[list[Value]]:
        """Return the lines of a section such as ``[PORTS]``; they may be nested in another list, as in a suite."""
        first = group.get(0)
        rows = first if len(group) == 1 and isinstance(first, Bottle) and isinstance(first.get(0), Bottle) else group
        return [[*row] if isinstance(row, Bottle) else [row] for row in rows]

    def open_stream(self, name: str, *, optional: bool = False, keep: bool = False, topic: bool = False) -> bool:
        """Record one more port, or a ``topic`` of ROS 2; return whether it exists.

        A missing one fails its sub-result, unless it is optional.
        """
        try:
            if topic:
                self.listener.add_topic(name, self.warn)
            else:
                self.listener.add(name, keep=keep)
        except RtfError as error:
            with self.subresult(name):
                if optional:
                    self.skip(f"{name} does not exist: {error}")
                self.assert_fail(f"cannot connect to {name}: {error}")
        return name in self.listener.recorders


class RateTest(StreamTest):
    """A test that judges the timing of streams, beside their content."""

    # Senders skip busy readers: on a loaded machine some messages are missing without a fault.
    max_loss = Parameter(float, "share of messages that may be missing", unit="%", default=5.0, low=0.0, high=100.0)
    max_duplicates = Parameter(int, "messages that may be repeated", unit="count", default=0, low=0)
    # A tenth of a second at 100 Hz: readers consider the stream broken by then.
    max_gap = Parameter(float, "longest time without a message, in expected periods", default=10.0, low=1.0)
    # A little more than a period of 100 Hz; and two periods, for messages by way of another machine.
    max_jitter = Parameter(
        float, "greatest delay of nine of ten messages behind the quickest one (lower confidence bound)", unit="ms",
        default=12.0, low=0.0,
    )  # fmt: skip
    max_latency = Parameter(
        float, "greatest median delay, if sender and test share a clock", unit="ms", default=20.0, low=0.0
    )

    def judge(self, found: Sequence[Message], rate: float, tolerance: float) -> Stream:
        """Measure rate, losses, duplicates, gaps, jitter and latency of a window, and fail for values out of bounds.

        On an overloaded machine, on which the sender may run, too, late and missing messages are inconclusive.
        """
        stream = stream_of(found)
        periods = stream.periods
        self.measure("rate is known within", periods.rate_interval, "Hz")
        self.measure("median period", periods.median * 1e3, "ms")
        self.measure("deviation of the periods", periods.deviation * 1e3, "ms")
        hint = f"{stream.duplicates} messages came again, with the same number; {likely_causes('duplicate')}"
        self.measure("duplicates", stream.duplicates, "count", high=self.max_duplicates, hint=hint)
        self.judge_stamps(stream, self.max_duplicates)
        self._plot(stream)
        values = [*self._amounts(stream, rate, tolerance), *self._ways(stream)]
        judge_values(self, "the stream", values, overload(self.listener.cpu_pressure))
        return stream

    def _amounts(self, stream: Stream, rate: float, tolerance: float) -> list[CheckedValue]:
        """Return rate, gaps and losses. Stalls of this machine are allowed for."""
        periods, stalled = stream.periods, min(1.0, self.listener.stalled / float(np.ptp(stream.times)))
        causes = f"; {likely_causes('slow')}" if periods.rate < rate else ""
        low = (rate - tolerance) * (1.0 - stalled)
        # A sender skips a reader for as long as it does not read.
        longest = 1e3 * (self.max_gap / rate + max(0.0, *self.listener.late))
        missing = f"{stream.lost} messages are missing among {stream.lost + len(stream.messages)}"
        nothing = f"no message for {periods.longest * 1e3:.1f} ms"
        lost = likely_causes("lost")
        return [
            CheckedValue("time in which this machine was suspended", 100.0 * stalled, "%"),
            CheckedValue("rate", periods.rate, "Hz", rate + tolerance, low=low, hint=f"{_rate_text(stream)}{causes}"),
            CheckedValue("longest period", periods.longest * 1e3, "ms", longest, hint=f"{nothing}; {lost}"),
            CheckedValue("lost", stream.loss, "%", self.max_loss + 100.0 * stalled, hint=f"{missing}; {lost}"),
        ]

    def _ways(self, stream: Stream) -> list[CheckedValue]:
        """Return jitter and latency; nothing without stamps."""
        if np.isnan(stream.delays).any():
            self.report("the messages have no stamps: jitter and latency are not judged")
            return []
        late = np.array(self.listener.late)
        # Allow for late wake-ups of this process and for the real-time factor of a simulation.
        factor = max(1.0, self.listener.factor)
        for percent in (90, 99):
            self.measure(f"jitter of {percent} of 100 messages", stream.jitter(percent / 100) * 1e3, "ms")
        scheduling = 0.0 if self.listener.exact else _SCHEDULING
        own_usual, own_worst = (float(np.quantile(late, share)) * 1e3 for share in (0.5, _JUDGED))
        behind = f", and {stream.overtaken} came after a later one" if stream.overtaken else ""
        jitter = self.max_jitter * factor + 2 * max(0.0, own_worst) + scheduling
        # The stamps of a real robot are by another clock, whose offset looks like latency.
        shared = not isinstance(self.clock, SystemClock)
        latency = self.max_latency * factor + 2 * max(0.0, own_usual) if shared else math.inf
        causes, usual = likely_causes("jitter"), float(np.median(stream.delays))
        return [
            CheckedValue(
                "jitter",
                stream.sure_jitter(_JUDGED) * 1e3,
                "ms",
                jitter,
                hint=f"messages come irregularly{behind}; {causes}",
            ),
            CheckedValue(
                "latency",
                usual * 1e3,
                "ms",
                latency,
                low=-latency,
                hint=f"messages come {'late' if usual >= 0.0 else 'before the time of their stamps'}; {causes}",
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
        return f"one of {stream.every} messages arrives"
    if stream.lost:
        return "messages are missing"
    return f"they are sent every {stream.periods.median * 1e3:.2f} ms"
