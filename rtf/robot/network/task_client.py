"""Base class of the clients of controllers in space, for our servers and those of the iCub."""

from __future__ import annotations

import threading
from contextlib import ExitStack, closing, suppress
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from rtf.bottle import Bottle, as_list, as_string
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.ports import remote as ports
from rtf.middleware.ports.buffered import BufferedPort, Received
from rtf.middleware.types import VECTOR
from rtf.middleware.wire.contact import Contact
from rtf.robot import parameters
from rtf.robot.device import Device
from rtf.robot.errors import DeviceError, NoAnswerError, NotSupportedError, RefusedError, RobotError
from rtf.robot.interfaces import ITaskControl
from rtf.robot.network.client_settings import RPC_TIMEOUT, unique_local
from rtf.robot.network.latest_message import LatestMessage, ReceivedValue
from rtf.robot.network.request_table import ACK, NACK, VERSION, RequestTable, event_of
from rtf.robot.network.stream_client import RpcConnection

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rtf.bottle import Property
    from rtf.robot.interfaces import EventObserver, FloatArray

#: Defaults of the originals: carrier of streams, events and streamed commands, and the greatest age of a state (s).
CARRIER, TIMEOUT = "udp", 0.1


class TaskClient(Device, ITaskControl):
    """The controller whose ports begin with ``remote``.

    ``local`` is the prefix of the client's own ports (default: a unique one), ``carrier`` that of streams, events and
    streamed commands (default udp), ``timeout`` the greatest age of a state in seconds of the robot's clock (default
    0.1), ``rpcTimeout`` that of a reply in seconds. The methods raise RefusedError for what the server refuses,
    NoAnswerError without a valid reply, StaleStateError for an old state.
    """

    #: What the controller is called in messages.
    kind: ClassVar[str]
    table: ClassVar[RequestTable]
    #: The ends of the ports of requests, here and there, and those of streamed commands and of streams, which are the
    #: same on both sides but for the direction. They are connected in this order.
    rpc_ends: ClassVar[tuple[str, str]]
    command_ends: ClassVar[Sequence[str]]
    stream_sizes: ClassVar[Mapping[str, int]]

    _opened: ExitStack | None = None

    def open(self, configuration: Property) -> None:
        """Open the ports in the order of the original, and connect them."""
        self._remote = remote = parameters.port_name(configuration, "remote")
        local = parameters.port_name(configuration, "local", "") or unique_local(remote)
        carrier = parameters.carrier(configuration, CARRIER)
        timeout = parameters.positive(configuration, "timeout", TIMEOUT)
        patience = parameters.positive(configuration, "rpcTimeout", RPC_TIMEOUT)
        self._contexts: list[int] = []
        self._shares: list[float] = []
        self._observers: tuple[EventObserver, ...] = ()
        self._changing = threading.Lock()
        with ExitStack() as opened:
            try:
                self._open_ports(opened, local, timeout)
                here, there = (f"{prefix}{end}" for prefix, end in zip((local, remote), self.rpc_ends, strict=True))
                self._rpc = opened.enter_context(
                    closing(RpcConnection(here, there, patience=patience, network=self.network))
                )
                self._check_version()
                self._connect(carrier)
            except MiddlewareError as error:
                raise DeviceError(f"{self.name} cannot be connected to {remote}: {error}; is it running?") from error
            self.check_ready()
            self._opened = opened.pop_all()

    def check_ready(self) -> None:
        """Check that the server is of use, at the end of ``open``. Raises DeviceError."""

    def _open_ports(self, opened: ExitStack, local: str, timeout: float) -> None:
        network = self.network
        self._commands: dict[str, BufferedPort[Bottle]] = {
            end: opened.enter_context(BufferedPort(f"{local}/{end}:o", network=network, inputs=False))
            for end in self.command_ends
        }
        self._streams: dict[str, LatestMessage[FloatArray]] = {
            end: opened.enter_context(
                closing(LatestMessage(f"{local}/{end}:i", VECTOR, timeout=timeout, network=network, lazily=True))
            )
            for end in self.stream_sizes
        }
        self._events = opened.enter_context(
            BufferedPort(f"{local}/events:i", strict=True, callback=self._happened, network=network, outputs=False)
        )

    def _connect(self, carrier: str) -> None:
        remote = self._remote
        for end, command in self._commands.items():
            command.add_output(f"{remote}/{end}:i", carrier)
        for end, stream in self._streams.items():
            stream.connect(f"{remote}/{end}:o", carrier)
        ports.connect(self.network, Contact(f"{remote}/events:o"), Contact(self._events.name), carrier)

    def _check_version(self) -> None:
        """Refuse a server of another version; one that does not say its version is taken, and reported."""
        version = next((as_string(pair[1]) for pair in _pairs(self.info()) if pair[0] == "server_version"), "")
        if not version:
            self.network.report(f"{self._remote} does not say its version; this is version {VERSION}")
        elif version != VERSION:
            raise NotSupportedError(f"{self._remote} has version {version!r} of {self.kind}, this is {VERSION!r}")

    def close(self) -> None:
        """Forget this client's contexts and checkpoints at the server, and close the ports."""
        if self._opened is None:
            return
        with suppress(RobotError):  # the server may be gone
            if self._contexts:
                self.delete_contexts(self._contexts)
            for share in list(self._shares):
                self.remove_checkpoint(share)
        self._opened.close()
        self._opened = None

    # Requests --------------------------------------------------------------------------------------------------------

    def call(self, key: str, *arguments: Any) -> Any:
        """Send the request of a method, and return its result."""
        request = self.table.request(key, *arguments)
        said = request.to_text()[:80]
        answer = self._rpc.ask(request)
        verdict, *values = answer.elements() or [""]
        if verdict == NACK:
            raise RefusedError(f"{self._remote} refused {said}")
        if verdict != ACK:
            raise NoAnswerError(f"{self._remote} answered {said} with {answer.to_text()[:80]!r}")
        try:
            return self.table.result(key, values)
        except RefusedError as error:
            raise NoAnswerError(f"{self._remote} answered {said} with nonsense: {error}") from error

    def call_array(self, key: str, *arguments: Any) -> FloatArray:
        """Send the request of a method, and return its result, which is an array."""
        return np.asarray(self.call(key, *arguments), dtype=np.float64)

    def call_bottle(self, key: str, *arguments: Any) -> Bottle:
        """Send the request of a method, and return its result, which is a list."""
        found = self.call(key, *arguments)
        assert isinstance(found, Bottle)
        return found

    def stream(self, end: str, command: Bottle) -> None:
        """Send a command that is not answered."""
        self._commands[end].write(command, strict=True)

    def latest(self, end: str) -> ReceivedValue[FloatArray]:
        """Return the latest message of a stream. Raises StaleStateError, and NoAnswerError for a wrong size."""
        found = self._streams[end].fresh()
        size = self.stream_sizes[end]
        if found.value.size != size:
            raise NoAnswerError(f"{self._remote}/{end}:o sends {found.value.size} numbers, not {size}")
        return found

    # Methods of all controllers --------------------------------------------------------------------------------------

    def stop(self) -> None:
        self.call("stop")

    def motion_done(self) -> bool:
        return bool(self.call("motion_done"))

    def info(self) -> Bottle:
        return self.call_bottle("info")

    def tracking(self) -> bool:
        return bool(self.call("tracking"))

    def set_tracking(self, tracking: bool) -> None:
        self.call("set_tracking", tracking)

    def tweaks(self) -> Bottle:
        return self.call_bottle("tweaks")

    def set_tweaks(self, tweaks: Bottle) -> None:
        self.call("set_tweaks", tweaks)

    def store_context(self) -> int:
        context = int(self.call("store_context"))
        self._contexts.append(context)
        return context

    def restore_context(self, context: int) -> None:
        self.call("restore_context", context)

    def delete_contexts(self, contexts: Sequence[int]) -> None:
        self.call("delete_contexts", contexts)
        self._contexts = [one for one in self._contexts if one not in contexts]

    def add_checkpoint(self, share: float) -> None:
        self.call("add_checkpoint", share)
        self._shares.append(share)

    def remove_checkpoint(self, share: float) -> None:
        self.call("remove_checkpoint", share)
        with suppress(ValueError):
            self._shares.remove(share)

    def checkpoints(self) -> FloatArray:
        return self.call_array("checkpoints")

    def observe_events(self, observer: EventObserver) -> None:
        with self._changing:
            self._observers = (*self._observers, observer)

    def unobserve_events(self, observer: EventObserver) -> None:
        with self._changing:
            self._observers = tuple(one for one in self._observers if one != observer)

    def _happened(self, message: Received[Bottle]) -> None:
        """Pass an event on. Runs in a thread of the port."""
        try:
            event = event_of(message.value)
        except RefusedError as error:
            self.network.report(f"{self._remote}/events:o sent {message.value.to_text()[:80]!r}: {error}")
            return
        for observer in self._observers:
            try:
                observer(event)
            except Exception as error:  # noqa: BLE001 - later events have to come, and the error is reported
                self.unobserve_events(observer)
                self.network.report(
                    f"{self.name}: an observer of events was removed, because it raised {type(error).__name__}: {error}"
                )


def _pairs(info: Bottle) -> list[Bottle]:
    lists = (as_list(one) for one in info)
    return [one for one in lists if one is not None and len(one) > 1]
