"""What the servers of sensors have in common: a stream with stamps, which pauses while nothing is well."""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import ExitStack, closing
from typing import TYPE_CHECKING, Any, Generic, Self, TypeVar

from rtf.middleware.rpc import RpcServer
from rtf.robot.errors import RobotError
from rtf.robot.server.answering import guarded
from rtf.robot.server.outlets import BackgroundOutlets
from rtf.robot.server.stamping import Stamping

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.bottle import Bottle
    from rtf.middleware.codecs import Codec
    from rtf.middleware.network import Network
    from rtf.robot.server.outlets import Outlet, Outlets

T = TypeVar("T")


class StreamServer(ABC, Generic[T]):
    """Publishes what ``measure`` gives, with stamps that count from 0.

    Whatever ``measure`` raises means that nothing is sent in that period, and is reported once. ``strict``: each
    message waits until all readers have got the one before, and none is skipped; otherwise a slow reader misses some.
    ``outlets`` opens the ports of the stream; a simulator has its own.
    """

    def __init__(
        self, name: str, *, network: Network, period: float, strict: bool = False, outlets: Outlets | None = None
    ) -> None:
        self.name = name
        self.period = period
        self.network = network
        self._outlets = outlets or BackgroundOutlets(network, strict=strict)
        self._stamping = Stamping()
        self._said = ""
        self._ports: list[Outlet] = []  # of what the server sends
        self._opened = ExitStack()

    @abstractmethod
    def measure(self, now: float) -> tuple[T, float] | None:
        """What is sent at ``now``, and the time of its stamp; None when there is nothing new."""

    def send(self, value: T, envelope: str) -> None:
        """Write it to the port, or each port its part."""
        for port in self._ports:
            port.write(value, envelope=envelope)

    def publish(self, now: float) -> None:
        """See Publisher. While nobody listens nothing is measured."""
        if not self.heard:
            return
        try:
            measured = self.measure(now)
        except Exception as error:  # noqa: BLE001 - a driver that fails now may work the next time, and it is told
            self._tell(str(error) if isinstance(error, RobotError) else f"{type(error).__name__}: {error}")
            return
        self._said = ""
        if measured is not None:
            value, time = measured
            self.send(value, self._stamping.next(time))

    def _tell(self, sentence: str) -> None:
        if sentence != self._said:
            self._said = sentence
            self.network.report(f"{self.name}: nothing is published: {sentence}")

    def open_ports(
        self, names: Sequence[str], codec: Codec[Any], rpc: str = "", answer: Callable[[Bottle], object] | None = None
    ) -> Self:
        """Open the ports of the stream, and one that answers questions; all of them or none."""
        with ExitStack() as opened:
            self._ports = [opened.enter_context(closing(self._outlets.open(name, codec))) for name in names]
            if answer is not None:
                handle = guarded(answer, port=rpc, network=self.network)
                opened.enter_context(RpcServer(rpc, handle, network=self.network))
            self._opened = opened.pop_all()
        return self

    @property
    def heard(self) -> bool:
        """Whether somebody reads."""
        for port in self._ports:  # noqa: SIM110 - a generator costs more than all else here
            if port.outputs:
                return True
        return False

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until what was published is sent; False when that takes longer, in s of the machine's clock."""
        return all(port.settle(timeout) for port in self._ports)

    def close(self) -> None:
        """Close the ports."""
        self._opened.close()
