"""Where servers send their streams: ports that serve slow readers in the background, unless a simulator has its own."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from rtf.middleware.buffered import BufferedPort
from rtf.middleware.pipelined_port import PipelinedPort

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.codecs import Codec
    from rtf.middleware.network import Network
    from rtf.middleware.outputs import Output


class Outlet(Protocol):
    """A port that a server sends a stream through."""

    @property
    def outputs(self) -> Sequence[Output]:
        """Who is connected."""

    def write(self, value: Any, *, envelope: str) -> object:  # Any: an object of the codec that it was opened with
        """Send an object with its stamp. It may be changed afterwards, except by readers of this process."""

    def settle(self, timeout: float | None = None) -> bool:
        """Wait until everybody has got what was written; False when that takes longer, in s of the machine's clock."""

    def close(self) -> None:
        """Close the port."""


class Outlets(Protocol):
    """What opens outlets."""

    def open(self, name: str, codec: Codec[Any]) -> Outlet:
        """Open a port for objects of a codec. Raises the middleware's errors."""


class BackgroundOutlets:
    """Outlets of a robot in real time: a reader that is slow misses messages, and nobody waits for it.

    ``strict``: no message is skipped; each waits until all readers have got the one before.
    """

    def __init__(self, network: Network, *, strict: bool = False) -> None:
        self._network = network
        self._strict = strict

    def open(self, name: str, codec: Codec[Any]) -> BackgroundOutlet:
        """See Outlets."""
        return BackgroundOutlet(name, codec, network=self._network, strict=self._strict)


class BackgroundOutlet:
    """One of them."""

    def __init__(self, name: str, codec: Codec[Any], *, network: Network, strict: bool) -> None:
        self.port: BufferedPort[Any] = BufferedPort(name, codec, network=network, inputs=False)
        self._strict = strict

    @property
    def outputs(self) -> Sequence[Output]:
        """See Outlet."""
        return self.port.outputs

    def write(self, value: Any, *, envelope: str) -> None:
        """See Outlet."""
        self.port.write(value, envelope=envelope, strict=self._strict)

    def settle(self, timeout: float | None = None) -> bool:
        """See Outlet."""
        return self.port.wait(timeout)

    def close(self) -> None:
        """See Outlet."""
        self.port.close()


class PostingOutlets:
    """Outlets for who publishes in step with something: ``write`` sends at once, ``settle`` waits for everybody."""

    def __init__(self, network: Network) -> None:
        self._network = network

    def open(self, name: str, codec: Codec[Any]) -> PipelinedPort:
        """See Outlets."""
        return PipelinedPort(name, codec, network=self._network)
