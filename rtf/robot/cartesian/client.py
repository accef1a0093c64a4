"""The client of Cartesian control, ``cartesiancontrollerclient``, for our servers and those of the iCub."""

from __future__ import annotations

import threading
from contextlib import ExitStack, closing, suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.bottle import Bottle, as_list, as_string
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.ports import remote as ports
from rtf.middleware.ports.buffered import BufferedPort, Received
from rtf.middleware.types import VECTOR
from rtf.middleware.wire.contact import Contact
from rtf.robot import parameters
from rtf.robot.cartesian import requests
from rtf.robot.cartesian.requests import ACK, BY_METHOD, NACK, POSE_SIZE, POSITION_SIZE, VELOCITY, VERSION
from rtf.robot.device import Device
from rtf.robot.errors import DeviceError, NoAnswerError, NotSupportedError, RefusedError, RobotError
from rtf.robot.interfaces.cartesian import CartesianPose, ICartesianControl
from rtf.robot.network.client_settings import RPC_TIMEOUT, unique_local
from rtf.robot.network.latest_message import LatestMessage
from rtf.robot.network.stream_client import RpcConnection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Property
    from rtf.robot.interfaces import FloatArray, Values
    from rtf.robot.interfaces.cartesian import CartesianPriority, CartesianSolution, EventObserver

#: Defaults of the original: carrier of poses, events and streamed commands, and the greatest age of a pose (s).
CARRIER, TIMEOUT = "udp", 0.1


class CartesianClient(Device, ICartesianControl):
    """``cartesiancontrollerclient``: the controller whose ports begin with ``remote``.

    ``local`` is the prefix of the client's own ports (default: a unique one), ``carrier`` that of poses, events and
    streamed commands (default udp), ``timeout`` the greatest age of a pose in seconds of the robot's clock (default
    0.1), ``rpcTimeout`` that of a reply in seconds. The methods raise RefusedError for what the server refuses,
    NoAnswerError without a valid reply, StaleStateError for an old pose.
    """

    _rpc: RpcConnection
    _state: LatestMessage[FloatArray]
    _command: BufferedPort[Bottle]
    _opened: ExitStack | None = None

    def open(self, configuration: Property) -> None:
        """Open the ports in the order of the original, and connect them. The server must have a solver."""
        remote = parameters.port_name(configuration, "remote")
        local = parameters.port_name(configuration, "local", "") or unique_local(remote)
        carrier = parameters.carrier(configuration, CARRIER)
        timeout = parameters.positive(configuration, "timeout", TIMEOUT)
        patience = parameters.positive(configuration, "rpcTimeout", RPC_TIMEOUT)
        network = self.network
        self._remote = remote
        self._contexts: list[int] = []
        self._shares: list[float] = []
        self._observers: tuple[EventObserver, ...] = ()
        self._changing = threading.Lock()
        with ExitStack() as opened:
            try:
                self._command = opened.enter_context(BufferedPort(f"{local}/command:o", network=network, inputs=False))
                self._state = opened.enter_context(
                    closing(LatestMessage(f"{local}/state:i", VECTOR, timeout=timeout, network=network, lazily=True))
                )
                events = opened.enter_context(
                    BufferedPort(
                        f"{local}/events:i", strict=True, callback=self._happened, network=network, outputs=False
                    )
                )
                self._rpc = opened.enter_context(
                    closing(RpcConnection(f"{local}/rpc:o", f"{remote}/rpc:i", patience=patience, network=network))
                )
                self._check_version()
                self._command.add_output(f"{remote}/command:i", carrier)
                self._state.connect(f"{remote}/state:o", carrier)
                ports.connect(network, Contact(f"{remote}/events:o"), Contact(events.name), carrier)
            except MiddlewareError as error:
                raise DeviceError(f"{self.name} cannot be connected to {remote}: {error}; is it running?") from error
            if not self.solver_connected():
                raise DeviceError(f"{remote} has no solver; start that first")
            self._opened = opened.pop_all()

    def _check_version(self) -> None:
        """Refuse a server of another version; one that does not say its version is taken, and reported."""
        version = next((as_string(pair[1]) for pair in _pairs(self.info()) if pair[0] == "server_version"), "")
        if not version:
            self.network.report(f"{self._remote} does not say its version; this is version {VERSION}")
        elif version != VERSION:
            raise NotSupportedError(f"{self._remote} has version {version!r} of Cartesian control, this is {VERSION!r}")

    def close(self) -> None:
        """Forget this client's contexts and checkpoints at the server, and close the ports."""
        if self._opened is None:
            return
        with suppress(RobotError):  # the server may be gone
            self.delete_contexts(self._contexts)
            for share in list(self._shares):
                self.remove_checkpoint(share)
        self._opened.close()
        self._opened = None

    # Requests --------------------------------------------------------------------------------------------------------

    def _ask(self, request: Bottle) -> list[Any]:
        """Send a request and return what follows ``[ack]``."""
        answer = self._rpc.ask(request)
        verdict, *values = answer.elements() or [""]
        if verdict == NACK:
            raise RefusedError(f"{self._remote} refused {request.to_text()[:80]}")
        if verdict != ACK:
            raise NoAnswerError(f"{self._remote} answered {request.to_text()[:80]} with {answer.to_text()[:80]!r}")
        return values

    def _call(self, method: str, *arguments: Any) -> Any:
        """Send the request of a method, and return its result."""
        row = BY_METHOD[method]
        request = Bottle([*row.words, *row.takes.write(*arguments)])
        values = self._ask(request)
        if row.gives is requests.NOTHING:
            return None
        try:
            return row.gives.read(values)[0]
        except RefusedError as error:
            raise NoAnswerError(f"{self._remote} answered {request.to_text()[:80]} with nonsense: {error}") from error

    # Motions ---------------------------------------------------------------------------------------------------------

    def go_to(self, target: Values, duration: float | None = None) -> None:
        self._ask(requests.motion(_numbers(target), duration))

    def stream_target(self, target: Values, duration: float | None = None) -> None:
        self._command.write(requests.motion(_numbers(target), duration), strict=True)

    def stream_velocity(self, velocity: Values) -> None:
        self._command.write(Bottle([VELOCITY, requests.floats(_numbers(velocity, POSE_SIZE))]), strict=True)

    def stop(self) -> None:
        self._call("stop")

    def motion_done(self) -> bool:
        return bool(self._call("motion_done"))

    def ask(self, target: Values, start: Values | None = None) -> CartesianSolution:
        given = None if start is None else np.atleast_1d(np.asarray(start, dtype=np.float64))
        values = self._ask(requests.question(_numbers(target), given))
        try:
            return requests.solution_of(values)
        except RefusedError as error:
            raise NoAnswerError(f"{self._remote} answered the question with nonsense: {error}") from error

    # State -----------------------------------------------------------------------------------------------------------

    def pose(self, link: int | None = None) -> CartesianPose:
        """Return the latest pose of the stream; of a link, ask."""
        if link is not None:
            found: CartesianPose = self._call("pose", link)
            return found
        latest = self._state.fresh()
        if latest.value.size != POSE_SIZE:
            raise NoAnswerError(f"{self._remote}/state:o sends {latest.value.size} numbers, not {POSE_SIZE}")
        return CartesianPose(latest.value.copy(), latest.time)

    def desired(self) -> CartesianSolution:
        found: CartesianSolution = self._call("desired")
        return found

    def joint_velocities(self) -> FloatArray:
        return _array(self._call("joint_velocities"))

    def task_velocity(self) -> FloatArray:
        return _array(self._call("task_velocity"))

    def solver_connected(self) -> bool:
        return bool(self._call("solver_connected"))

    def info(self) -> Bottle:
        return _bottle(self._call("info"))

    # Settings --------------------------------------------------------------------------------------------------------

    def trajectory_time(self) -> float:
        return float(self._call("trajectory_time"))

    def set_trajectory_time(self, duration: float) -> None:
        self._call("set_trajectory_time", requests.finite(duration))

    def tolerance(self) -> float:
        return float(self._call("tolerance"))

    def set_tolerance(self, tolerance: float) -> None:
        self._call("set_tolerance", requests.finite(tolerance))

    def tracking(self) -> bool:
        return bool(self._call("tracking"))

    def set_tracking(self, tracking: bool) -> None:
        self._call("set_tracking", tracking)

    def reference_feedback(self) -> bool:
        return bool(self._call("reference_feedback"))

    def set_reference_feedback(self, feedback: bool) -> None:
        self._call("set_reference_feedback", feedback)

    def priority(self) -> CartesianPriority:
        found = self._call("priority")
        if found == "position":
            return "position"
        if found == "orientation":
            return "orientation"
        raise NoAnswerError(f"{self._remote} has the priority {found!r}")

    def set_priority(self, priority: CartesianPriority) -> None:
        self._call("set_priority", priority)

    def active_joints(self) -> tuple[bool, ...]:
        return tuple(map(bool, self._call("active_joints")))

    def set_active_joints(self, active: Sequence[bool | None]) -> tuple[bool, ...]:
        return tuple(map(bool, self._call("set_active_joints", active)))

    def rest_posture(self) -> FloatArray:
        return _array(self._call("rest_posture"))

    def set_rest_posture(self, posture: Values) -> FloatArray:
        return _array(self._call("set_rest_posture", np.atleast_1d(np.asarray(posture, dtype=np.float64))))

    def rest_weights(self) -> FloatArray:
        return _array(self._call("rest_weights"))

    def set_rest_weights(self, weights: Values) -> FloatArray:
        return _array(self._call("set_rest_weights", np.atleast_1d(np.asarray(weights, dtype=np.float64))))

    def limits(self, joint: int) -> tuple[float, float]:
        low, high = self._call("limits", joint)
        return float(low), float(high)

    def set_limits(self, joint: int, minimum: float, maximum: float) -> None:
        self._call("set_limits", joint, requests.finite(minimum), requests.finite(maximum))

    def tip(self) -> FloatArray:
        return _array(self._call("tip"))

    def set_tip(self, tip: Values) -> None:
        self._call("set_tip", _numbers(tip, POSE_SIZE))

    def tweaks(self) -> Bottle:
        return _bottle(self._call("tweaks"))

    def set_tweaks(self, tweaks: Bottle) -> None:
        self._call("set_tweaks", tweaks)

    # Contexts --------------------------------------------------------------------------------------------------------

    def store_context(self) -> int:
        context = int(self._call("store_context"))
        self._contexts.append(context)
        return context

    def restore_context(self, context: int) -> None:
        self._call("restore_context", context)

    def delete_contexts(self, contexts: Sequence[int]) -> None:
        self._call("delete_contexts", contexts)
        self._contexts = [one for one in self._contexts if one not in contexts]

    # Events ----------------------------------------------------------------------------------------------------------

    def add_checkpoint(self, share: float) -> None:
        self._call("add_checkpoint", requests.finite(share))
        self._shares.append(share)

    def remove_checkpoint(self, share: float) -> None:
        self._call("remove_checkpoint", requests.finite(share))
        with suppress(ValueError):
            self._shares.remove(share)

    def checkpoints(self) -> FloatArray:
        return _array(self._call("checkpoints"))

    def observe_events(self, observer: EventObserver) -> None:
        with self._changing:
            self._observers = (*self._observers, observer)

    def unobserve_events(self, observer: EventObserver) -> None:
        with self._changing:
            self._observers = tuple(one for one in self._observers if one != observer)

    def _happened(self, message: Received[Bottle]) -> None:
        """Pass an event on. Runs in a thread of the port."""
        try:
            event = requests.event_of(message.value)
        except RefusedError as error:
            self.network.report(f"{self._remote}/events:o sent {message.value.to_text()[:80]!r}: {error}")
            return
        for observer in self._observers:
            observer(event)


def _numbers(values: Values, *sizes: int) -> FloatArray:
    """Return a target of three or seven numbers, or of one of the sizes. Raises RefusedError."""
    found = np.atleast_1d(np.asarray(values, dtype=np.float64))
    wanted = sizes or (POSITION_SIZE, POSE_SIZE)
    if found.ndim != 1 or found.size not in wanted:
        raise RefusedError(f"{' or '.join(map(str, wanted))} numbers are needed, not {found.size}")
    return found


def _array(found: object) -> FloatArray:
    return np.asarray(found, dtype=np.float64)


def _bottle(found: object) -> Bottle:
    assert isinstance(found, Bottle)
    return found


def _pairs(info: Bottle) -> list[Bottle]:
    lists = (as_list(one) for one in info)
    return [one for one in lists if one is not None and len(one) > 1]
