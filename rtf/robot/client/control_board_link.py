"""The connections of a client with a board: RPC, command stream and state, which are reconnected together."""

from __future__ import annotations

import contextlib
import threading
from typing import TYPE_CHECKING, Generic, TypeVar

from rtf import clock
from rtf.bottle import as_int
from rtf.errors import RtfError
from rtf.middleware.ports import remote
from rtf.middleware.ports.qos import Qos
from rtf.middleware.wire.contact import Contact
from rtf.robot.client.board_requests import GETTING
from rtf.robot.client.command_stream import CommandStream
from rtf.robot.client.rpc import BoardRpc
from rtf.robot.client.state_reader import StateReader
from rtf.robot.errors import DeviceError, NoAnswerError, UnreachableError
from rtf.robot.extended_state import MAX_AXES
from rtf.robot.vocabulary import Shape

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network
    from rtf.robot.client.settings import ClientSettings

#: Seconds between attempts to reconnect the state, so that a loop that reads it is not blocked each time.
_BETWEEN = 1.0


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
        axes = self.rpc.get_at_once(GETTING["axes"][Shape.NONE])
        count = as_int(axes[0]) if len(axes) == 1 else 0
        board = self.settings.remote
        if not 1 <= count <= MAX_AXES:
            raise NoAnswerError(f"{board} does not answer with a number of joints but with {axes}")
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
            self.rpc.get_at_once(GETTING["axes"][Shape.NONE])
        except NoAnswerError:
            return False
        return True
