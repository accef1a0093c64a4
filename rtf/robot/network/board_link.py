"""The connections of a client with a board: requests, command stream and state, which are reconnected together."""

from __future__ import annotations

import contextlib
import threading
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar, Generic, TypeVar

from rtf import clock
from rtf.errors import RtfError
from rtf.middleware.ports import remote
from rtf.middleware.ports.qos import Qos
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.wire.contact import Contact
from rtf.robot.errors import DeviceError, NoAnswerError, UnreachableError
from rtf.robot.extended_state import MAX_AXES
from rtf.robot.network.state_reader import StateReader
from rtf.robot.network.streamed_commands import CommandStream

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.ports.network import Network
    from rtf.robot.network.client_settings import ClientSettings

#: Seconds between attempts to reconnect the state, so that a loop that reads it is not blocked each time.
_BETWEEN = 1.0
#: Timeout in seconds of an action that is answered when it is done, such as the calibration of a whole part.
ACTION_LIMIT = 600.0


class BoardRpc(ABC):
    """The RPC connection to a board, from a port whose name begins with ``local``. Each protocol has its subclass.

    A board answers the requests of a client in order. Every request has a timeout, ``limit`` in seconds. After it the
    connection is closed, because a late reply would be taken for that to the next request, and reopened by the next
    request. No request is repeated automatically: the board may have executed it. ``remade`` is called to reconnect a
    lost connection before it is used.

    All methods may be called from any thread; each waits for earlier requests to be answered.
    """

    #: The suffixes of the port names of the two ends.
    ends: ClassVar[tuple[str, str]]

    def __init__(self, local: str, board: str, *, network: Network, limit: float, remade: Callable[[], None]) -> None:
        self.board = board
        self._network = network
        self._limit = limit
        self._remade = remade
        here, there = self.ends
        self._target = Contact(f"{board}/{there}")
        self._port = RpcClient(f"{local}/{here}", network=network)

    @property
    def connected(self) -> bool:
        """Whether the connection exists, as far as is known."""
        return bool(self._port.outputs)

    def reconnect(self) -> None:
        """Connect by tcp, or reconnect. Raises MiddlewareError."""
        self.disconnect()
        self._port.add_output(self._target, "tcp")

    def disconnect(self) -> None:
        """Disconnect; the next use reconnects."""
        self._port.remove_output(self._target.name)

    def close(self) -> None:
        """Disconnect."""
        self._port.close()

    @abstractmethod
    def check_protocol(self, *, ignore: bool) -> None:
        """Check that the board speaks this protocol. Raises NotSupportedError unless ``ignore`` is set."""

    @abstractmethod
    def count_axes(self) -> int:
        """Ask for the number of axes, without reconnecting. Raises NoAnswerError."""

    def separate_port(self) -> RpcClient:
        """Open another connection to the board, for a request that takes long. Raises NoAnswerError."""
        try:
            return RpcClient("", self._target, network=self._network)
        except RtfError as error:
            raise NoAnswerError(f"{self.board} cannot be reached: {error}") from error


Rpc = TypeVar("Rpc", bound=BoardRpc)


class ControlBoardLink(Generic[Rpc]):
    """The RPC connection, the command stream and the state of a board. ``asking`` is the RPC class of its protocol.

    Raises DeviceError if the board cannot be reached; then nothing stays open.

    A lost connection is noticed when it is used, or when no state arrives any more. The thread that needs it reconnects
    it. If the board still answers requests, only the lost connection is made again; else all of them, because a
    restarted board has forgotten them. Each step takes at most the network's ``patience``, each reply at most the
    client's timeout.
    """

    def __init__(self, settings: ClientSettings, network: Network, asking: type[Rpc]) -> None:
        self.settings = settings
        self._network = network
        self._lock = threading.Lock()
        self._tried = 0.0
        self.axes = 0
        board, local = settings.remote, settings.local
        with contextlib.ExitStack() as undo:
            try:
                self.rpc = asking(local, board, network=network, limit=settings.rpc_timeout, remade=self._remake_rpc)
                undo.callback(self.rpc.close)
                self.stream = CommandStream(
                    f"{local}/command:o",
                    board,
                    network=network,
                    carrier=settings.carrier,
                    limit=settings.rpc_timeout,
                    strict=settings.strict,
                    remade=self._remake_stream,
                )
                undo.callback(self.stream.close)
                self.state = StateReader(
                    f"{local}/stateExt:i",
                    board,
                    network=network,
                    carrier=settings.carrier,
                    timeout=settings.timeout,
                    lost=self._remake_state,
                    diagnostic=settings.diagnostic,
                )
                undo.callback(self.state.close)
                self._connect()
            except RtfError as error:
                raise DeviceError(f"{board} cannot be opened: {error}") from error
            self._undo = undo.pop_all()

    def close(self) -> None:
        """Disconnect. A second call has no effect."""
        self._undo.close()

    def _connect(self) -> None:
        self.rpc.reconnect()
        self.stream.reconnect()
        self.state.reconnect()
        self._set_qos()
        self.rpc.check_protocol(ignore=self.settings.ignore_protocol)
        count = self.rpc.count_axes()
        board = self.settings.remote
        if not 1 <= count <= MAX_AXES:
            raise NoAnswerError(f"{board} says that it has {count} joints; 1 to {MAX_AXES} are possible")
        if self.axes and count != self.axes:
            raise NoAnswerError(f"{board} has {count} joints now, it had {self.axes}; open it again")
        self.axes = count
        self.state.axes = count
        self._tried = clock.monotonic()

    def _set_qos(self) -> None:
        local, distant = self.settings.local_qos, self.settings.remote_qos
        if local == distant == Qos():
            return
        stream, state = self.stream, self.state
        remote.set_connection_qos(self._network, state.source, Contact(state.name), distant, local)
        remote.set_connection_qos(self._network, Contact(stream.name), stream.target, local, distant)

    # Reconnecting ------------------------------------------------------------------------------------------------

    def _remake_rpc(self) -> None:
        with self._lock:
            if not self.rpc.connected:
                self._remake(self.rpc)

    def _remake_stream(self) -> None:
        with self._lock:
            if not self.stream.connected:
                self._remake(self.stream)

    def _remake_state(self) -> None:
        """Try to reconnect the state, at most once per interval and in one thread. The caller gets its error anyway."""
        if clock.monotonic() - self._tried < _BETWEEN or not self._lock.acquire(blocking=False):
            return
        try:
            with contextlib.suppress(NoAnswerError):
                self._remake(self.state)
        finally:
            self._lock.release()

    def _remake(self, lost: BoardRpc | CommandStream | StateReader) -> None:
        """Reconnect one connection while the board still answers over RPC, else all of them."""
        self._tried = clock.monotonic()
        try:
            if self.rpc.connected and self._answers():
                lost.reconnect()
            else:
                self._connect()
                self._network.report(f"{self.settings.remote} was lost and is connected again")
        except RtfError as error:
            self.rpc.disconnect()  # nothing may be sent to what may be another board
            self.stream.disconnect()
            raise UnreachableError(f"{self.settings.remote} cannot be reached again: {error}") from error

    def _answers(self) -> bool:
        try:
            self.rpc.count_axes()
        except NoAnswerError:
            return False
        return True
