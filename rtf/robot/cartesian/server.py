"""The server of Cartesian control: the ports of a controller.

=================  ====================================================================================================
``NAME/rpc:i``     requests, see :mod:`rtf.robot.cartesian.requests`; each client is served in a thread of its own, so
                   one that waits for a motion to begin does not keep another from stopping it
``NAME/command:i`` streamed targets and velocities, without an answer
``NAME/state:o``   the pose of the tip with its stamp, while there is a solver
``NAME/events:o``  events with their stamps; none is skipped
=================  ====================================================================================================
"""

from __future__ import annotations

from contextlib import ExitStack, closing
from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle import Bottle, BottleError, as_vocab
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcServer
from rtf.middleware.types import VECTOR
from rtf.middleware.types.codecs import BOTTLE
from rtf.robot.cartesian import requests
from rtf.robot.cartesian.requests import ACK, ASK, BY_WORDS, GO, NACK, POSE_SIZE, VELOCITY
from rtf.robot.errors import RefusedError, RobotError
from rtf.robot.interfaces.cartesian import CartesianEvent
from rtf.robot.network.outlets import BackgroundOutlets, StampCounter
from rtf.robot.network.stream_server import StreamServer, with_error_replies

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Value
    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.interfaces.cartesian import ICartesianControl
    from rtf.robot.publishing import Outlets

#: Seconds of real time for the last event to be received.
_GOODBYE = 1.0
_MOST_WORDS = 3


class CartesianServer(StreamServer["FloatArray"]):
    """The ports of a controller; ``period`` in s is that of its poses.

    Raises ConnectError and AddressError.
    """

    def __init__(
        self,
        control: ICartesianControl,
        name: str,
        *,
        network: Network,
        period: float = 0.01,
        outlets: Outlets | None = None,
    ) -> None:
        super().__init__(name, network=network, period=period, outlets=outlets)
        self._control = control
        self._event_stamps = StampCounter()
        with ExitStack() as opened:
            self.open_ports([f"{name}/state:o"], VECTOR)
            opened.callback(super().close)
            strict = outlets or BackgroundOutlets(strict=True)
            self._events = opened.enter_context(closing(strict.open(f"{name}/events:o", BOTTLE, network)))
            opened.enter_context(Port(f"{name}/command:i", self._take, network=network, outputs=False, guarded=True))
            answer = with_error_replies(self.answer, port=name, network=network, failure=Bottle([NACK]))
            opened.enter_context(RpcServer(f"{name}/rpc:i", answer, network=network, guarded=True))
            control.observe_events(self._send)
            opened.callback(control.unobserve_events, self._send)
            self._everything = opened.pop_all()

    def measure(self, now: float) -> tuple[FloatArray, float] | None:
        if not self._control.solver_connected():
            return None
        pose = self._control.pose()
        return pose.vector, pose.time or now  # of boards that do not tell the time of their encoders

    def close(self) -> None:
        """Close the ports, after an event that says so."""
        if self._events.outputs:
            self._send(CartesianEvent("closing", clock.current().now()))
            self._events.settle(_GOODBYE)
        self._everything.close()

    def _send(self, event: CartesianEvent) -> None:
        self._events.write(requests.event(event), envelope=self._event_stamps.next(event.time))

    # Requests --------------------------------------------------------------------------------------------------------

    def answer(self, request: Bottle) -> Bottle:
        """Return the reply to a request. Raises RobotError and BottleError, which stand for ``[nack]``."""
        words = tuple(as_vocab(value) for value in request[:_MOST_WORDS])
        rest = list(request[1:])
        if words[:1] == (GO,):
            target, duration = requests.motion_of(rest)
            self._control.go_to(target, duration)
            return Bottle([ACK])
        if words[:1] == (ASK,):
            return Bottle([ACK, *requests.solution(self._control.ask(*requests.question_of(rest)))])
        for count in range(len(words), 0, -1):
            row = BY_WORDS.get(words[:count])
            if row is not None:
                break
        else:
            raise RefusedError(f"{self.name} does not know {request.to_text()[:80]}")
        rest = list(request[count:])
        if row.silent and not rest:
            return Bottle()
        result = getattr(self._control, row.method)(*row.takes.read(rest))
        return Bottle([ACK, *(row.gives.write(result) if row.gives is not requests.NOTHING else [])])

    def _take(self, delivery: IncomingMessage) -> None:
        """Take a streamed command. One that is invalid, or refused, is reported and ignored."""
        try:
            self._command(delivery.read().elements())
        except (RobotError, BottleError) as error:
            self.network.report(f"{self.name}/command:i: a command is ignored: {error}")

    def _command(self, command: Sequence[Value]) -> None:
        word = as_vocab(command[0] if command else None)
        if word == GO:
            self._control.stream_target(*requests.motion_of(command[1:]))
        elif word == VELOCITY and len(command) > 1:
            self._control.stream_velocity(requests.array(command[1], POSE_SIZE))
        else:
            raise RefusedError(f"{self.name} has no command {Bottle(command).to_text()[:80]}")
