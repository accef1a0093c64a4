"""The stream of commands from a client to a board, which are not answered: velocities and immediate setpoints."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rtf import clock
from rtf.bottle import Bottle, Value
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.types import Pair
from rtf.middleware.wire.contact import Contact
from rtf.robot.errors import NoAnswerError
from rtf.robot.vocabulary import COMMAND

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rtf.middleware.ports.network import Network
    from rtf.robot.interfaces import FloatArray


class CommandStream:
    """The port that streams commands to a board. May be used from any thread.

    A command is sent in the background. While the previous one is in transit, a strict command waits for it, at most
    ``limit`` seconds, and any other is skipped: the next one follows soon. By a simulator's clock each is sent before
    ``send`` returns, so that it arrives at the simulated time of the call. ``strict`` overrides the choice for all
    commands unless it is None. ``remade`` is called to reconnect a lost connection before it is used.
    """

    def __init__(
        self,
        name: str,
        board: str,
        *,
        network: Network,
        carrier: str,
        limit: float,
        strict: bool | None,
        remade: Callable[[], None],
    ) -> None:
        self.board = board
        self._target = Contact(f"{board}/command:i")
        self._carrier = carrier
        self._limit = limit
        self._strict = strict
        self._remade = remade
        self._port: BufferedPort[Pair[Bottle, NDArray[Any]]] = BufferedPort(
            name, COMMAND, network=network, inputs=False
        )

    @property
    def name(self) -> str:
        """The name of the port."""
        return self._port.name

    @property
    def target(self) -> Contact:
        """The port of the board."""
        return self._target

    @property
    def connected(self) -> bool:
        """Whether the connection exists, as far as is known."""
        return bool(self._port.outputs)

    def reconnect(self) -> None:
        """Connect, or reconnect. Raises MiddlewareError."""
        self._port.add_output(self._target, self._carrier)

    def disconnect(self) -> None:
        """Disconnect; the next use reconnects."""
        self._port.remove_output(self._target.name)

    def close(self) -> None:
        """Send what is in transit, then disconnect."""
        self._port.close()

    def send(self, head: list[Value], values: FloatArray, *, strict: bool) -> None:
        """Send a command and its values. Raises NoAnswerError without a connection, or after the limit."""
        port = self._port
        if not port.outputs:
            self._remade()
        if self._strict is not None:
            strict = self._strict
        if strict:
            self._drain()
        if not port.write(Pair(Bottle.adopt(head), values)) and strict:
            raise NoAnswerError(f"the connection with {self._target.name} was lost, and the streamed command with it")
        if type(clock.current()) is not clock.SystemClock:
            self._drain()

    def _drain(self) -> None:
        if not self._port.wait(self._limit):
            raise NoAnswerError(f"{self.board} has not received the previous command within {self._limit:g} s")
