"""The ports on which the simulated robot publishes, with the faults of the network.

In lockstep a message has been sent when ``write`` returns; ``settle`` waits until all readers that acknowledge have
received it, before the time advances. In real time readers are served in the background, and ``settle`` has an effect
only while there are participants in the simulated time.
"""

from __future__ import annotations

import copy
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias

from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.pipelined_port import PATIENCE, PipelinedPort

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from rtf.middleware.ports.network import Network
    from rtf.middleware.ports.outputs import Output
    from rtf.middleware.types.codecs import Codec
    from rtf.simulator.simulation import Simulation

    #: Maps the delays (s) of the copies of a message, at a time (s), to new delays: to lose, repeat or delay it.
    Disturbance: TypeAlias = Callable[[list[float], float], list[float]]


#: Messages that are sent together, which wakes a reader once; it reads them while the next ones are computed.
_TOGETHER = 8


class SimulatedOutlet:
    """A port that publishes.

    ``disturbances`` lose, repeat and delay its messages, ``restamps`` change their stamps; both can be changed at any
    step.
    """

    def __init__(self, port: PipelinedPort | BufferedPort[Any], simulation: Simulation) -> None:
        self.port = port
        self.disturbances: list[Disturbance] = []
        self.restamps: list[Callable[[str], str]] = []
        self._simulation = simulation

    @property
    def outputs(self) -> Sequence[Output]:
        """The connected readers."""
        return self.port.outputs

    def write(self, value: Any, *, envelope: str) -> None:
        """Send an object with its stamp."""
        for restamp in self.restamps:
            envelope = restamp(envelope)
        if not self.disturbances:
            self.port.write(value, envelope=envelope)
            return
        delays = [0.0]
        for disturbance in self.disturbances:
            delays = disturbance(delays, self._simulation.now)
        for delay in delays:
            if delay > 0:
                self._simulation.after(delay, partial(self._write_late, copy.deepcopy(value), envelope))
            else:
                self.port.write(value, envelope=envelope)

    def _write_late(self, value: Any, envelope: str) -> None:
        if not self.port.closed:
            self.port.write(value, envelope=envelope)

    def flush(self) -> None:
        """Send the collected messages without waiting for the readers."""
        if isinstance(self.port, PipelinedPort):
            self.port.flush()

    def settle(self, timeout: float | None = PATIENCE) -> bool:
        """Wait until all readers have received it; False after ``timeout`` s of real time."""
        return self.port.settle(timeout) if isinstance(self.port, PipelinedPort) else self.port.wait(timeout)

    def close(self) -> None:
        """Close the port."""
        self.port.close()


class SimulatedOutlets:
    """All ports on which a simulation publishes, by name."""

    def __init__(self, simulation: Simulation, *, lockstep: bool) -> None:
        self._simulation = simulation
        self._lockstep = lockstep
        self.by_name: Mapping[str, SimulatedOutlet] = {}  # replaced at every change, as the simulation reads it

    def open(self, name: str, codec: Codec[Any], network: Network) -> SimulatedOutlet:
        """Open a port for objects of a codec."""
        port: PipelinedPort | BufferedPort[Any]
        if self._lockstep:
            port = PipelinedPort(name, codec, network=network, together=_TOGETHER)
        else:
            port = BufferedPort(name, codec, network=network, inputs=False)
        outlet = SimulatedOutlet(port, self._simulation)
        self.by_name = {**self.by_name, port.name: outlet}
        return outlet

    def settle(self) -> None:
        """Wait until all readers have received all messages."""
        self.flush()  # all readers work at the same time
        for outlet in self.by_name.values():
            if outlet.outputs:
                outlet.settle()

    def flush(self) -> None:
        """Send the collected messages of all ports without waiting for the readers."""
        for outlet in self.by_name.values():
            outlet.flush()
