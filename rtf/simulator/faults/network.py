"""Faults of the network, of the streams that servers publish, and of the program itself."""

from __future__ import annotations

import os
from signal import SIGKILL, SIGSTOP, Signals
from typing import TYPE_CHECKING, ClassVar

from rtf.robot.errors import RefusedError
from rtf.simulator.faults.base import Fault, Layer, Parameter, RobotFault, Target

if TYPE_CHECKING:
    from rtf.simulator.outlets import SimulatedOutlet


class _PortFault(Fault):
    layer = Layer.NETWORK
    target_kind = Target.PORT
    outlet: SimulatedOutlet

    def aim(self) -> None:
        known = self.robot.outlets.by_name
        if self.target not in known:
            raise RefusedError(
                f"{self.kind}: nothing is published at {self.target!r}, but at {', '.join(sorted(known))}"
            )
        self.outlet = known[self.target]

    def begin(self) -> None:
        self.outlet.disturbances.append(self.disturb)

    def end(self) -> None:
        self.outlet.disturbances.remove(self.disturb)

    def disturb(self, delays: list[float], now: float) -> list[float]:
        """What becomes of a message that is to be sent with these delays (s), each once."""
        raise NotImplementedError


class Latency(_PortFault):
    """See ``meaning``."""

    kind = "latency"
    meaning = "Messages come late."
    shows = "The time between stamp and arrival; the rate stays."
    parameters = (Parameter("delay", 0.05, "s", "by which each is late", 0.0, 60.0),)
    delay: float

    def disturb(self, delays: list[float], now: float) -> list[float]:
        del now
        return [delay + self.delay for delay in delays]


class Jitter(_PortFault):
    """See ``meaning``."""

    kind = "jitter"
    meaning = "Messages come at irregular times."
    shows = "The deviation of the periods grows; the mean stays."
    parameters = (Parameter("most", 0.02, "s", "the greatest delay", 0.0, 60.0),)
    most: float

    def disturb(self, delays: list[float], now: float) -> list[float]:
        del now
        return [delay + float(self.simulation.random.uniform(0.0, self.most)) for delay in delays]


class Loss(_PortFault):
    """See ``meaning``."""

    kind = "loss"
    meaning = "Messages get lost on the way."
    shows = "Gaps in the numbers of the stamps; fewer messages than expected."
    parameters = (Parameter("share", 0.2, "", "of the messages", 0.0, 1.0),)
    share: float

    def disturb(self, delays: list[float], now: float) -> list[float]:
        del now
        return [delay for delay in delays if self.simulation.random.random() >= self.share]


class Duplicate(_PortFault):
    """See ``meaning``."""

    kind = "duplicate"
    meaning = "Messages come twice."
    shows = "The same number and the same contents one after the other."
    parameters = (Parameter("share", 0.2, "", "of the messages", 0.0, 1.0),)
    share: float

    def disturb(self, delays: list[float], now: float) -> list[float]:
        del now
        twice = self.simulation.random.random() < self.share
        return [delay for delay in delays for _ in range(2 if twice else 1)]


class WrongRate(_PortFault):
    """See ``meaning``."""

    kind = "wrong_rate"
    meaning = "The stream is slower than it should be: only one of so many messages is sent."
    shows = "The mean period is a multiple of the right one."
    parameters = (Parameter("every", 2.0, "", "one of so many is sent", 1.0, 1e6),)
    every: float
    _count = 0

    def disturb(self, delays: list[float], now: float) -> list[float]:
        del now
        self._count += 1
        return delays if self._count % max(1, round(self.every)) == 0 else []


class _ProcessFault(RobotFault):
    """What a signal does to the program that is the robot."""

    layer = Layer.PROCESS
    signal: ClassVar[Signals]

    def begin(self) -> None:
        os.kill(os.getpid(), self.signal)

    def end(self) -> None:
        """See Fault. From within nothing can be done."""


class Crash(_ProcessFault):
    """See ``meaning``."""

    kind = "crash"
    meaning = "The program that is the robot dies at once."
    shows = "All ports are gone, and nobody takes them back."
    signal = SIGKILL


class Hang(_ProcessFault):
    """See ``meaning``. Whoever wants it to go on sends SIGCONT."""

    kind = "hang"
    meaning = "The program that is the robot stops to work, and stays."
    shows = "Ports take connections and never answer; streams end."
    signal = SIGSTOP


KINDS = (Latency, Jitter, Loss, Duplicate, WrongRate, Crash, Hang)
