"""The rates of connections: those that the kernel counts, all the time, and of others when they are asked for.

Ports of YARP do not count their messages. The kernel counts what comes by TCP connections of this machine, of all
programs, and reading its counters costs no port anything. What it does not count is measured by reading the source
for a moment.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf import clock
from rtf.applications.page.view import key_of
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.ports import remote
from rtf.middleware.ports.port import Port
from rtf.middleware.tools.monitor import PortState, Traffic
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rtf.applications.xml.model import Connection
    from rtf.middleware.ports.inputs import Input
    from rtf.middleware.ports.network import Network
    from rtf.middleware.types.codecs import Buffer

#: Seconds for which a port is read.
DURATION = 2.0


@dataclass(frozen=True, slots=True)
class Rate:
    """Messages and bytes a second."""

    messages: float
    bytes: float


@dataclass(frozen=True, slots=True)
class LiveRate:
    """What comes to the target of a connection: bytes a second, and messages where they can be counted, else None.

    ``shared`` connections come to that port, and are counted together.
    """

    bytes: float
    messages: float | None
    shared: int


class LiveRates:
    """The rates of connections whose targets are on this machine and that use TCP, between one call and the next."""

    def __init__(self, network: Network) -> None:
        self._network = network
        self._traffic = Traffic()

    def rates(self, connected: Sequence[Connection]) -> Mapping[str, LiveRate]:
        """Return the rates of connections by key; those that are not counted are left out."""
        if not connected:
            return {}
        try:
            known = {one.name: one for one in self._network.names.list()}
        except MiddlewareError:
            return {}
        shared = Counter(str(one.target.port) for one in connected)
        ports = [PortState(known[name], inputs=(name,)) for name in shared if name in known]
        flows = self._traffic.flows(ports)
        return {
            key_of(one): LiveRate(round(flow.bandwidth, 1), flow.rate and round(flow.rate, 2), shared[one.target.port])
            for one in connected
            if (flow := flows.get(one.target.port)) is not None
        }


class _Counter(Port):
    """Counts what comes, from the first message to the last, without reading it."""

    def __init__(self, network: Network) -> None:
        self.sizes: list[int] = []
        self.first = self.last = 0.0
        super().__init__("", lambda _: None, network=network, outputs=False)

    def dispatch(self, caller: Input, key: str, text: str, data: Buffer) -> Sequence[Buffer]:
        if key not in ("D", "d"):
            return super().dispatch(caller, key, text, data)
        self.last = clock.monotonic()
        self.first = self.first or self.last
        self.sizes.append(len(data))
        return ()

    def rate(self) -> Rate:
        """Return the rate. The first message begins the time, and is not counted."""
        sizes = self.sizes[1:]
        span = self.last - self.first
        if not sizes or span <= 0:
            return Rate(len(self.sizes) / DURATION, sum(self.sizes) / DURATION)
        return Rate(len(sizes) / span, sum(sizes) / span)


def measure(network: Network, source: str) -> Rate:
    """Read a port for :data:`DURATION` seconds and return its rate. Raises MiddlewareError."""
    with _Counter(network) as port:
        remote.connect(network, Contact(source), Contact(port.name))
        clock.sleep(DURATION)
        return port.rate()
