"""CAN bus load: the buses of a part carry what they should, at the right times, and nothing else."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.devices.can.motor_messages import VERSION
from rtf.robot.errors import DeviceError
from rtf.robot_testing import likely_causes
from rtf.robot_testing.can_test import CanTest, OpenBus
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.robot_testing.judging.can_traffic import BoardOnBus, CanTraffic

#: Questions to each board whose answers are timed.
_QUESTIONS = 5
_WINDOW = 0.1  # s, of the greatest load
_PERCENT = 100.0
_SHOWN = 5
#: What the driver counts that must not happen while the bus is watched.
_NEVER = ("bus_off", "expired", "refused", "error_frames", "read_errors")


class CanBusLoad(CanTest):
    """Records the frames of the buses of a part while nothing moves, and judges them by the protocol.

    The load, the rate of each periodic message, frames that came twice or overtook each other, frames of nobody, the
    boards' and the host's counts of errors, and how fast boards answer. It only listens and asks.
    """

    tags = ("can",)

    time = Parameter(float, "how long the buses are recorded", unit="s", default=2.0, low=0.5)
    # ln 2, below which any set of periodic streams with priorities is on time (Liu and Layland 1973).
    max_load = Parameter(float, "greatest load of a bus", unit="%", default=69.0, low=1.0, high=100.0)
    # Nodes of a bus understand each other with clocks that differ by 1.58 % at most (ISO 11898-1); frames are not lost.
    rate_tolerance = Parameter(float, "tolerance of the rates", unit="%", default=2.0, low=0.0, high=50.0)
    # None by the protocol; time stamps that an operating system makes may be late.
    max_irregular = Parameter(
        float, "share of frames that may come too soon after the one before", unit="%", default=1.0, low=0.0, high=100.0
    )
    # One disturbed frame counts 8 at its sender (ISO 11898-1).
    max_errors = Parameter(int, "greatest count of errors of a board", unit="count", default=8, low=0)
    # The time-out of questions of the iCub's hosts.
    max_answer = Parameter(float, "greatest median time until a board answers", unit="ms", default=20.0, low=0.1)
    others = Parameter(
        list[int], "addresses of other boards on the buses that do not answer as boards of sensors", default=[]
    )

    def run(self) -> None:
        """Record all buses, then judge each."""
        versions = {channel: self.versions(bus) for channel, bus in self.buses.items()}
        sensors = {channel: self.others_on(bus) for channel, bus in self.buses.items()}
        before = self.host_counters()
        self.listen(self.time)
        traffics = {channel: bus.traffic() for channel, bus in self.buses.items()}
        after = self.host_counters()
        for channel, bus in self.buses.items():
            boards, traffic = self.boards_of(channel, versions[channel]), traffics[channel]
            with self.subresult(channel):
                self._judge_bus(bus, traffic, boards, [*self.others, *sensors[channel]])
            for board in boards:
                with self.subresult(f"{channel}:{board.address}"):
                    self._judge_board(bus, traffic, board)
            for address in set(self.addresses(channel)) - versions[channel].keys():
                with self.subresult(f"{channel}:{address}"):
                    self.assert_fail(f"{self.named(channel, address)} does not answer; {likely_causes('board silent')}")
        self._judge_host(before, after)

    # A bus -------------------------------------------------------------------------------------------------------

    def _judge_bus(self, bus: OpenBus, traffic: CanTraffic, boards: list[BoardOnBus], others: list[int]) -> None:
        name = f"the bus {bus.name}"
        self.assert_fail_if_false(
            traffic.seconds > self.time / 2,
            f"on {name} frames came for {traffic.seconds:.2f} s of {self.time:g} s only; {likely_causes('bus dead')}",
        )
        self._plot(traffic)
        self.measure("frames", len(traffic.frames) / traffic.seconds, "Hz")
        self.measure(f"load in the busiest {_WINDOW:g} s", _PERCENT * traffic.busiest(_WINDOW), "%")
        most = max(traffic.streams, key=traffic.load_of)
        hint = (
            f"{name} is too busy; identifier {most:#05x} has {_PERCENT * traffic.load_of(most):.1f} % of it; "
            f"{likely_causes('bus load')}"
        )
        self.measure("load", _PERCENT * traffic.load, "%", high=self.max_load, hint=hint)
        strangers = traffic.strangers(boards, others)
        hint = (
            f"on {name} frames come from nobody: {_counted(strangers)}; if there are boards with these addresses that "
            f"do not answer, name them in 'others'; {likely_causes('frames of nobody')}"
        )
        self.measure("frames of nobody", sum(strangers.values()), "count", high=0, hint=hint)
        damaged = traffic.unreadable(boards)
        hint = f"on {name} frames have wrong lengths: {_counted(damaged)}; {likely_causes('frames of nobody')}"
        self.measure("frames that are no messages", sum(damaged.values()), "count", high=0, hint=hint)
        self._judge_regularity(name, traffic, boards)

    def _judge_regularity(self, name: str, traffic: CanTraffic, boards: list[BoardOnBus]) -> None:
        found = [
            (traffic.repetition(number, traffic.cycle_of(board)), len(traffic.of(number).times))
            for board in boards
            for number in traffic.expected(board)
        ]
        frames = max(1, sum(count for _, count in found))
        expected = sum(sum(traffic.expected(board).values()) for board in boards)
        soon = sum(one.repeated + one.overtaken for one, _ in found)
        twice = frames > expected * (1 + self.rate_tolerance / _PERCENT)
        what = "come twice" if twice else "are overtaken by the next one with their identifier"
        causes = likely_causes("frames twice" if twice else "frames overtaken")
        hint = f"on {name} {soon} of {frames} frames {what}; {causes}"
        self.measure("frames too soon", _PERCENT * soon / frames, "%", high=self.max_irregular, hint=hint)

    # A board -----------------------------------------------------------------------------------------------------

    def _judge_board(self, bus: OpenBus, traffic: CanTraffic, board: BoardOnBus) -> None:
        name = self.named(bus.name, board.address)
        rates = {
            number: len(traffic.of(number).times) / expected
            for number, expected in traffic.expected(board).items()
            if expected
        }
        lowest, highest = min(rates, key=lambda one: rates[one]), max(rates, key=lambda one: rates[one])
        tolerance = self.rate_tolerance + _PERCENT / max(1.0, min(traffic.expected(board).values()))
        for what, number in (("lowest", lowest), ("highest", highest)):
            few = rates[number] < 1.0
            hint = (
                f"{name}: {_PERCENT * rates[number]:.1f} % of the expected frames {number:#05x} arrive; "
                f"{likely_causes('frames lost' if few else 'frames twice')}"
            )
            self.measure(
                f"{what} rate, of the expected one",
                _PERCENT * rates[number],
                "%",
                low=_PERCENT - tolerance,
                high=_PERCENT + tolerance,
                hint=hint,
            )
        sent, received = traffic.errors(board)
        hint = f"{name} counts errors of the bus; {likely_causes('bus errors')}"
        self.measure("errors of transmission", sent, "count", high=self.max_errors, hint=hint)
        self.measure("errors of reception", received, "count", high=self.max_errors, hint=hint)
        self._judge_answers(bus, board, name)

    def _judge_answers(self, bus: OpenBus, board: BoardOnBus, name: str) -> None:
        times = self._answer_times(bus, board.address)
        self.assert_fail_if_false(len(times), f"{name} answers no question; {likely_causes('board silent')}")
        usual, hint = 1e3 * float(np.median(times)), f"{name} answers late; {likely_causes('frames late')}"
        self.measure("median time until it answers", usual, "ms", high=self.max_answer, hint=hint)

    def _answer_times(self, bus: OpenBus, board: int) -> list[float]:
        """Return the times (s) from questions to their answers, by the stamps of the frames."""
        bus.clear()
        for _ in range(_QUESTIONS):
            try:
                bus.exchange.version(board)
            except DeviceError as error:
                self.report(str(error))
                break
        asked, answered = (message.identifier(board) for message in (VERSION.get, VERSION.value))
        found, since = [], math.nan
        for frame, time in bus.traffic().frames:  # in the order in which they came; a question may be seen twice
            if frame.identifier == asked and math.isnan(since):
                since = time
            elif frame.identifier == answered and not math.isnan(since):
                found.append(time - since)
                since = math.nan
        return found

    # The host ----------------------------------------------------------------------------------------------------

    def _judge_host(self, before: dict[str, dict[str, float]], after: dict[str, dict[str, float]]) -> None:
        for name, counters in after.items():
            more = {key: counters[key] - before.get(name, {}).get(key, 0.0) for key in _NEVER if key in counters}
            wrong = ", ".join(f"{key} {count:.0f}" for key, count in more.items() if count > 0)
            self.check_fail_if_true(
                wrong,
                f"the driver counts on the bus {name}, in {self.time:g} s: {wrong}; {likely_causes('bus errors')}",
            )

    def _plot(self, traffic: CanTraffic) -> None:
        numbers = [*traffic.streams]
        self.record(
            "identifiers",
            identifier=(np.array(numbers, dtype=float), ""),
            rate=(np.array([len(traffic.of(one).times) for one in numbers]) / traffic.seconds, "Hz"),
            load=(_PERCENT * np.array([traffic.load_of(one) for one in numbers]), "%"),
        )


def _counted(frames: dict[int, int]) -> str:
    most = sorted(frames, key=lambda one: -frames[one])
    text = ", ".join(f"{number:#05x} {frames[number]} times" for number in most[:_SHOWN])
    return f"{text} and {len(most) - _SHOWN} other identifiers" if len(most) > _SHOWN else text
