"""Faults of the network, of published streams, and of the robot program."""

from __future__ import annotations

import os
from signal import SIGKILL, SIGSTOP, Signals
from typing import TYPE_CHECKING, ClassVar

from rtf.robot.errors import RefusedError
from rtf.simulator.faults.base import Fault, Layer, Parameter, RobotFault, Target

if TYPE_CHECKING:
    from rtf.simulator.simulated_outlets import SimulatedOutlet


class _PortFault(Fault):
    layer = Layer.NETWORK
    target_kind = Target.PORT
    outlet: SimulatedOutlet

    def aim(self) -> None:
        known = self.robot.outlets.by_name
        if self.target not in known:
            raise RefusedError(f"{self.kind}: there is no stream {self.target!r}; there are {', '.join(sorted(known))}")
        self.outlet = known[self.target]

    def begin(self) -> None:
        self.outlet.disturbances.append(self.disturb)

    def end(self) -> None:
        self.outlet.disturbances.remove(self.disturb)

    def disturb(self, delays: list[float], now: float) -> list[float]:
        """Return the delays (s) of the copies of a message, for those that it had so far."""
        raise NotImplementedError


class Latency(_PortFault):
    """Constant delay of all messages of a port."""

    kind = "latency"
    description = "Messages come late."
    symptom = "The time between stamp and arrival grows; the rate stays."
    parameters = (Parameter("delay", 0.05, "s", "delay of each message", 0.0, 60.0),)
    delay: float

    def disturb(self, delays: list[float], now: float) -> list[float]:
        del now
        return [delay + self.delay for delay in delays]


class Jitter(_PortFault):
    """Random delay of the messages of a port."""

    kind = "jitter"
    description = "Messages come at irregular times."
    symptom = "The deviation of the periods grows; the mean stays."
    parameters = (Parameter("most", 0.02, "s", "the greatest delay", 0.0, 60.0),)
    most: float

    def disturb(self, delays: list[float], now: float) -> list[float]:
        del now
        return [delay + float(self.simulation.random.uniform(0.0, self.most)) for delay in delays]


class Loss(_PortFault):
    """Random loss of messages of a port."""

    kind = "loss"
    description = "Messages are lost on the way."
    symptom = "The sequence numbers of the stamps have gaps; there are fewer messages than expected."
    parameters = (Parameter("share", 0.2, "", "of the messages", 0.0, 1.0),)
    share: float

    def disturb(self, delays: list[float], now: float) -> list[float]:
        del now
        return [delay for delay in delays if self.simulation.random.random() >= self.share]


class Duplicate(_PortFault):
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


class WrongRate(_PortFault):
    """Transmission of only some messages of a port."""

    kind = "wrong_rate"
    description = "The stream is too slow: only every n-th message is sent."
    symptom = "The mean period is a multiple of the right one."
    parameters = (Parameter("every", 2.0, "", "n", 1.0, 1e6),)
    every: float
    _count = 0

    def disturb(self, delays: list[float], now: float) -> list[float]:
        del now
        self._count += 1
        return delays if self._count % max(1, round(self.every)) == 0 else []


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


KINDS = (Latency, Jitter, Loss, Duplicate, WrongRate, Crash, Hang)
