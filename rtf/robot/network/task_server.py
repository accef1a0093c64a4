"""Base class of the servers of controllers in space: requests, events, streamed commands and streams of the state."""

from __future__ import annotations

from contextlib import ExitStack, closing
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Protocol, TypeVar

from rtf import clock
from rtf.bottle import Bottle, BottleError
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcServer
from rtf.middleware.types import VECTOR
from rtf.middleware.types.codecs import BOTTLE
from rtf.robot.errors import RobotError
from rtf.robot.interfaces import ControllerEvent
from rtf.robot.network import request_table
from rtf.robot.network.outlets import BackgroundOutlets, StampCounter
from rtf.robot.network.request_table import NACK, RequestTable
from rtf.robot.network.stream_server import StreamServer, with_error_replies

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.bottle import Value
    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage
    from rtf.robot.interfaces import ITaskControl
    from rtf.robot.publishing import Outlets

T = TypeVar("T")
#: Seconds of real time for the last event to be received.
_GOODBYE = 1.0


class TaskServer(StreamServer[T]):
    """The ports of a controller; ``period`` in s is that of its streams, which send vectors.

    A subclass names the ends of its ports: the streams, the streamed commands with what takes them, and the requests.
    Raises ConnectError and AddressError.
    """

    table: ClassVar[RequestTable]
    streams: ClassVar[Sequence[str]]
    rpc_end: ClassVar[str]

    def __init__(
        self,
        control: ITaskControl,
        name: str,
        *,
        network: Network,
        period: float = 0.01,
        outlets: Outlets | None = None,
    ) -> None:
        super().__init__(name, network=network, period=period, outlets=outlets)
        self.task = control  # which answers the requests
        self._event_stamps = StampCounter()
        with ExitStack() as opened:
            self.open_ports([f"{name}{end}" for end in self.streams], VECTOR)
            opened.callback(super().close)
            strict = outlets or BackgroundOutlets(strict=True)
            self._events = opened.enter_context(closing(strict.open(f"{name}/events:o", BOTTLE, network)))
            for end, take in self.commands():
                taking = _reported(take, f"{name}{end}", network)
                opened.enter_context(Port(f"{name}{end}", taking, network=network, outputs=False, guarded=True))
            answer = with_error_replies(self.answer, port=name, network=network, failure=Bottle([NACK]))
            opened.enter_context(RpcServer(f"{name}{self.rpc_end}", answer, network=network, guarded=True))
            control.observe_events(self._send)
            opened.callback(control.unobserve_events, self._send)
            self._everything = opened.pop_all()

    def commands(self) -> Sequence[tuple[str, Callable[[Sequence[Value]], None]]]:
        """Return the ends of the ports of streamed commands, and what takes one or raises RefusedError."""
        return ()

    def answer(self, request: Bottle) -> Bottle:
        """Return the reply to a request. Raises RobotError and BottleError, which stand for ``[nack]``."""
        return self.table.answer(self.task, request)

    def close(self) -> None:
        """Close the ports, after an event that says so."""
        if self._events.outputs:
            self._send(ControllerEvent("closing", clock.current().now()))
            self._events.settle(_GOODBYE)
        self._everything.close()

    def _send(self, event: ControllerEvent) -> None:
        self._events.write(request_table.event(event), envelope=self._event_stamps.next(event.time))


class PeriodicControl(Protocol):
    """A controller that does its work in periods."""

    def publish(self, now: float) -> None:
        """Do what a period needs, at the robot's time. Raises RobotError."""

    def stop(self) -> None:
        """End a motion. Raises RobotError for boards that do not answer."""


C = TypeVar("C", bound=PeriodicControl)


class ControlledServer(Generic[C]):
    """A controller and its server, which publishes what the period before has led to."""

    def __init__(self, controller: C, server: TaskServer[Any]) -> None:
        self.period = server.period
        self.controller, self.server = controller, server

    def publish(self, now: float) -> None:
        """Control, then publish. Raises RobotError."""
        try:
            self.controller.publish(now)
        finally:
            self.server.publish(now)

    def close(self) -> None:
        """End a motion, and close the ports. A board that cannot be stopped any more is reported."""
        try:
            self.controller.stop()
            self.controller.publish(clock.current().now())
        except RobotError as error:
            self.server.network.report(f"{self.server.name}: the motion was not ended: {error}")
        self.server.close()


def _reported(
    take: Callable[[Sequence[Value]], None], port: str, network: Network
) -> Callable[[IncomingMessage], None]:
    """Return what takes a message. A command that is invalid, or refused, is reported and ignored."""

    def taking(delivery: IncomingMessage) -> None:
        try:
            take(delivery.read().elements())
        except (RobotError, BottleError) as error:
            network.report(f"{port}: a command is ignored: {error}")

    return taking
