"""Base class of sensor servers: a stream with stamps, which pauses while measuring fails."""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import ExitStack, closing
from typing import TYPE_CHECKING, Any, Generic, Self, TypeVar

from rtf.bottle import BottleError
from rtf.middleware.ports.rpc import RpcServer
from rtf.middleware.types import FAIL
from rtf.robot.errors import RobotError
from rtf.robot.network.outlets import BackgroundOutlets, StampCounter

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.bottle import Bottle, Dialect
    from rtf.middleware.ports.network import Network
    from rtf.middleware.types.codecs import Codec
    from rtf.robot.publishing import Outlet, Outlets

T = TypeVar("T")


class StreamServer(ABC, Generic[T]):
    """Publishes the results of ``measure``, with stamps that count from 0.

    If ``measure`` raises an error, nothing is sent in that period, and the error is reported once. ``strict``: each
    message waits until all readers have received the previous one, and none is skipped; otherwise a slow reader misses
    some. ``outlets`` opens the ports of the stream; a simulator passes its own.
    """

    def __init__(
        self, name: str, *, network: Network, period: float, strict: bool = False, outlets: Outlets | None = None
    ) -> None:
        self.name = name
        self.period = period
        self.network = network
        self._outlets = outlets or BackgroundOutlets(strict=strict)
        self._stamps = StampCounter()
        self._reported = ""
        self._ports: list[Outlet] = []  # of the stream
        self._opened = ExitStack()

    @abstractmethod
    def measure(self, now: float) -> tuple[T, float] | None:
        """Return the data to send at ``now`` and their time; None if there is nothing new."""

    def send(self, value: T, envelope: str) -> None:
        """Write the data to every port."""
        for port in self._ports:
            port.write(value, envelope=envelope)

    def publish(self, now: float) -> None:
        """Measure and publish, if there are readers."""
        if not self.heard:
            return
        try:
            measured = self.measure(now)
        except Exception as error:  # noqa: BLE001 - the driver may work again in the next period, and the error is reported
            self._report_once(str(error) if isinstance(error, RobotError) else f"{type(error).__name__}: {error}")
            return
        self._reported = ""
        if measured is not None:
            value, time = measured
            self.send(value, self._stamps.next(time))

    def _report_once(self, sentence: str) -> None:
        if sentence != self._reported:
            self._reported = sentence
            self.network.report(f"{self.name}: nothing is published: {sentence}")

    def open_ports(
        self,
        names: Sequence[str],
        codec: Codec[Any],
        rpc: str | Sequence[str] = "",
        answer: Callable[[Bottle], object] | None = None,
        *,
        dialect: Dialect | None = None,
    ) -> Self:
        """Open the ports of the stream, and one or several RPC ports if there is a handler; all of them or none.

        ``dialect`` is that of the RPC ports; None: that of the network.
        """
        outlets = self._outlets
        with ExitStack() as opened:
            self._ports = [opened.enter_context(closing(outlets.open(name, codec, self.network))) for name in names]
            if answer is not None:
                network = self.network if dialect is None else self.network.in_dialect(dialect)
                for name in [rpc] if isinstance(rpc, str) else rpc:
                    handle = with_error_replies(answer, port=name, network=self.network)
                    opened.enter_context(RpcServer(name, handle, network=network))
            self._opened = opened.pop_all()
        return self

    @property
    def heard(self) -> bool:
        """Whether there are readers."""
        for port in self._ports:  # noqa: SIM110 - a generator costs more than all else here
            if port.outputs:
                return True
        return False

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until everything published is sent; False after ``timeout`` s of real time."""
        return all(port.settle(timeout) for port in self._ports)

    def close(self) -> None:
        """Close the ports."""
        self._opened.close()


def with_error_replies(
    answer: Callable[[Bottle], object], *, port: str, network: Network, failure: object = FAIL
) -> Callable[[Bottle], object]:
    """Wrap a request handler: any exception becomes the reply ``failure``.

    A refusal of the device and an invalid request are errors of the client; all other exceptions are errors of the
    server and are reported.
    """

    def answered(request: Bottle) -> object:
        try:
            return answer(request)
        except (RobotError, BottleError):
            return failure
        except Exception as error:  # noqa: BLE001 - the port must survive errors of a driver; they are reported
            network.report(f"{port}: {request.to_text()[:80]!r} failed: {type(error).__name__}: {error}")
            return failure

    return answered
