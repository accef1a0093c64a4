"""The rate of a port: measured by reading it for a moment, as ports of YARP do not count their messages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf import clock
from rtf.middleware.ports import remote
from rtf.middleware.ports.port import Port
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from collections.abc import Sequence

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
