"""The three connections of a client with a board: they are made together, and together made anew."""

from __future__ import annotations

import contextlib
import threading
from typing import TYPE_CHECKING, Generic, TypeVar

from rtf import clock
from rtf.bottle import as_int
from rtf.errors import RtfError
from rtf.middleware import remote
from rtf.middleware.names import Contact
from rtf.middleware.qos import Qos
from rtf.robot.client.questions import GETTING
from rtf.robot.client.rpc import BoardRpc
from rtf.robot.client.state import StateReader
from rtf.robot.client.streaming import CommandStream
from rtf.robot.errors import DeviceError, NoAnswerError, UnreachableError
from rtf.robot.extended_state import MAX_AXES
from rtf.robot.vocabulary import Shape

if TYPE_CHECKING:
    from rtf.middleware.network import Network
    from rtf.robot.client.settings import ClientSettings

#: Seconds between attempts to have the state sent again, so that who reads a state in a loop is not held up each time.
_BETWEEN = 1.0


Rpc = TypeVar("Rpc", bound=BoardRpc)


class ControlBoardLink(Generic[Rpc]):
    """Questions, commands and state; boards of each dialect have their kind of ``asking``.

    Raises DeviceError when the board cannot be reached; then nothing is left.

    A connection that is lost is noticed when it is used, or when no state comes any more. It is made anew by the thread
    that needs it; all of them are unless the board still answers questions, because a board that was started again has
    forgotten them. Each step of that takes no longer than the network's ``patience``, each answer no longer than the
    client's limit.
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
        """Disconnect. Doing so again changes nothing."""
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
            raise NoAnswerError(f"{board} does not say how many joints it has but {axes}")
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

    # Making it anew ----------------------------------------------------------------------------------------------

    def _remake_rpc(self) -> None:
        with self._lock:
            if not self.rpc.connected:
                self._remake(self.rpc)

    def _remake_stream(self) -> None:
        with self._lock:
            if not self.stream.connected:
                self._remake(self.stream)

    def _remake_state(self) -> None:
        """Try it, now and then, unless another thread is at it; whoever reads gets its error in any case."""
        if clock.monotonic() - self._tried < _BETWEEN or not self._lock.acquire(blocking=False):
            return
        try:
            with contextlib.suppress(NoAnswerError):
                self._remake(self.state)
        finally:
            self._lock.release()

    def _remake(self, lost: BoardRpc | CommandStream | StateReader) -> None:
        """Make one connection anew while the board still answers in the old one, else all."""
        self._tried = clock.monotonic()
        try:
            if self.rpc.connected and self._answers():
                lost.reconnect()
            else:
                self._connect()
                self._network.report(f"{self.settings.remote} was lost, and has been connected to again")
        except RtfError as error:
            self.rpc.disconnect()  # nothing goes to what may be another board
            self.stream.disconnect()
            raise UnreachableError(f"{self.settings.remote} cannot be reached again: {error}") from error

    def _answers(self) -> bool:
        try:
            self.rpc.get_at_once(GETTING["axes"][Shape.NONE])
        except NoAnswerError:
            return False
        return True
