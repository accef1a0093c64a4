"""Faults of the network, of published streams, and of the robot program."""

from __future__ import annotations

import math
import os
from signal import SIGKILL, SIGSTOP, Signals
from typing import TYPE_CHECKING, ClassVar

from rtf.middleware.types import Stamp
from rtf.robot.errors import RefusedError
from rtf.simulator.faults.base import Fault, Layer, Parameter, RobotFault, Target

if TYPE_CHECKING:
    from rtf.simulator.simulated_outlets import SimulatedOutlet


class _PortFault(Fault):
    """A fault of one port."""

    layer = Layer.NETWORK
    target_kind = Target.PORT
    outlet: SimulatedOutlet

    def aim(self) -> None:
        known = self.robot.outlets.by_name
        if self.target not in known:
            raise RefusedError(f"{self.kind}: there is no stream {self.target!r}; there are {', '.join(sorted(known))}")
        self.outlet = known[self.target]


class _DeliveryFault(_PortFault):
    """A fault that loses, repeats or delays messages."""

    def begin(self) -> None:
        self.outlet.disturbances.append(self.disturb)

    def end(self) -> None:
        self.outlet.disturbances.remove(self.disturb)

    def disturb(self, delays: list[float], now: float) -> list[float]:
        """Return the delays (s) of the copies of a message, for those that it had so far."""
        raise NotImplementedError


class Latency(_DeliveryFault):
    """Constant delay of all messages of a port."""

    kind = "latency"
    description = "Messages come late."
    symptom = "The time between stamp and arrival grows; the rate stays."
    parameters = (Parameter("delay", 0.05, "s", "delay of each message", 0.0, 60.0),)
    delay: float

    def disturb(self, delays: list[float], now: float) -> list[float]:
        del now
        return [delay + self.delay for delay in delays]


class Jitter(_DeliveryFault):
    """Random delay of the messages of a port."""

    kind = "jitter"
    description = "Messages come at irregular times."
    symptom = "The deviation of the periods grows; the mean stays."
    parameters = (Parameter("most", 0.02, "s", "the greatest delay", 0.0, 60.0),)
    most: float

    def disturb(self, delays: list[float], now: float) -> list[float]:
        del now
        return [delay + float(self.simulation.random.uniform(0.0, self.most)) for delay in delays]


class Loss(_DeliveryFault):
    """Random loss of messages of a port."""

    kind = "loss"
    description = "Messages are lost on the way."
    symptom = "The sequence numbers of the stamps have gaps; there are fewer messages than expected."
    parameters = (Parameter("share", 0.2, "", "of the messages", 0.0, 1.0),)
    share: float

    def disturb(self, delays: list[float], now: float) -> list[float]:
        del now
        return [delay for delay in delays if self.simulation.random.random() >= self.share]


class Duplicate(_DeliveryFault):
    """Repetition of messages of a port."""

    kind = "duplicate"
    description = "Messages come twice."
    symptom = "A sequence number, and the contents, come twice in a row."
    parameters = (Parameter("share", 0.2, "", "of the messages", 0.0, 1.0),)
    share: float

    def disturb(self, delays: list[float], now: float) -> list[float]:
        del now
        twice = self.simulation.random.random() < self.share
        return [delay for delay in delays for _ in range(2 if twice else 1)]


class WrongRate(_DeliveryFault):
    """Transmission of only some messages of a port."""

    kind = "wrong_rate"
    description = "The stream is too slow: only every n-th message is sent."
    symptom = "The mean period is a multiple of the right one."
    parameters = (Parameter("every", 2.0, "", "n", 1.0, 1e6, healthy=1.0),)
    every: float
    _count = 0

    def disturb(self, delays: list[float], now: float) -> list[float]:
        del now
        self._count += 1
        return delays if self._count % max(1, round(self.every)) == 0 else []


class OldStamps(_PortFault):
    """Messages with the time of an earlier one; their numbers are right."""

    kind = "old_stamps"
    description = "Messages have old time stamps, or those of a clock that is wrong."
    symptom = "Sequence numbers count, and times repeat, go back, or are not those of the robot."
    parameters = (
        Parameter("share", 0.1, "", "of the messages", 0.0, 1.0),
        Parameter(
            "behind",
            0.0,
            "s",
            "how much the time is too early, negative: too late; 0: it is that of the message before",
            -60.0,
            60.0,
        ),
    )
    share: float
    behind: float
    _time = math.nan  # of the last message

    def begin(self) -> None:
        self.outlet.restamps.append(self.restamp)

    def end(self) -> None:
        self.outlet.restamps.remove(self.restamp)

    def restamp(self, envelope: str) -> str:
        """Return the stamp of a message, which may be old."""
        stamp = Stamp.parse(envelope)
        if stamp is None:
            return envelope
        time = stamp.time
        if not math.isnan(self._time) and self.simulation.random.random() < self.share:
            time = time - self.behind if self.behind else self._time
        self._time = time
        return str(Stamp(stamp.count, time))


class _ProcessFault(RobotFault):
    """A fault that sends a signal to the robot program."""

    layer = Layer.PROCESS
    signal: ClassVar[Signals]

    def begin(self) -> None:
        os.kill(os.getpid(), self.signal)

    def end(self) -> None:
        """Do nothing: the program cannot undo it itself."""


class Crash(_ProcessFault):
    """Sudden end of the robot program."""

    kind = "crash"
    description = "The robot program dies at once."
    symptom = "All ports are closed, and their names stay registered."
    signal = SIGKILL


class Hang(_ProcessFault):
    """Stop of the robot program; SIGCONT lets it continue."""

    kind = "hang"
    description = "The robot program stops working, and does not end."
    symptom = "Ports take connections and never answer; streams end."
    signal = SIGSTOP


KINDS = (Latency, Jitter, Loss, Duplicate, WrongRate, OldStamps, Crash, Hang)
