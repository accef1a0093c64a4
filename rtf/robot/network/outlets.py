"""Outlets: the ports through which servers send streams, in the background or in lockstep with a simulator.

The stamps of the messages are here, too.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

from rtf.bottle.values import INT32_MAX
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.pipelined_port import PATIENCE, PipelinedPort

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.ports.network import Network
    from rtf.middleware.ports.outputs import Output
    from rtf.middleware.types.codecs import Codec


class BackgroundOutlets:
    """Outlets for real time: a slow reader misses messages, and the server does not wait for it.

    ``strict``: no message is skipped; each waits until all readers have received the previous one. A reader that takes
    too long for one is removed, as in lockstep.
    """

    def __init__(self, *, strict: bool = False) -> None:
        self._strict = strict

    def open(self, name: str, codec: Codec[Any], network: Network) -> BackgroundOutlet:
        """Open a port for objects of a codec."""
        return BackgroundOutlet(name, codec, network=network, strict=self._strict)


class BackgroundOutlet:
    """An outlet that sends in the background."""

    def __init__(self, name: str, codec: Codec[Any], *, network: Network, strict: bool) -> None:
        patience = PATIENCE if strict else None
        self.port: BufferedPort[Any] = BufferedPort(name, codec, network=network, inputs=False, patience=patience)
        self._strict = strict

    @property
    def outputs(self) -> Sequence[Output]:
        """The connected readers."""
        return self.port.outputs

    def write(self, value: Any, *, envelope: str) -> None:
        """Send an object with its stamp."""
        self.port.write(value, envelope=envelope, strict=self._strict)

    def settle(self, timeout: float | None = None) -> bool:
        """Wait until all readers have received it; False after ``timeout`` s of real time."""
        return self.port.wait(timeout)

    def close(self) -> None:
        """Close the port."""
        self.port.close()


class PipelinedOutlets:
    """Outlets for lockstep publishing: ``write`` sends at once, ``settle`` waits for all readers."""

    def open(self, name: str, codec: Codec[Any], network: Network) -> PipelinedPort:
        """Open a port for objects of a codec."""
        return PipelinedPort(name, codec, network=network)


class StampCounter:
    """Generates the stamps of a stream, counting from ``first``; the count after the maximum is 0."""

    def __init__(self, first: int = 0) -> None:
        self._count = first

    def next(self, time: float) -> str:
        """Return the envelope of the next message, the text of a :class:`~rtf.middleware.types.Stamp`."""
        count = self._count
        self._count = count + 1 if count < INT32_MAX else 0
        return f"{count} {_text(time)}"


@lru_cache(maxsize=16)
def _text(time: float) -> str:
    """Return the text of a time; cached, as many streams have the same."""
    return f"{time:.15g}"
