"""The commands that a client sends and nobody answers: velocities, and references that are followed at once."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rtf import clock
from rtf.bottle import Bottle, Value
from rtf.middleware.buffered import BufferedPort
from rtf.middleware.names import Contact
from rtf.middleware.types import Pair
from rtf.robot.errors import NoAnswerError
from rtf.robot.vocabulary import COMMAND

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rtf.middleware.network import Network
    from rtf.robot.interfaces import FloatArray


class CommandStream:
    """The port from which commands stream to a board. May be used from any thread.

    A command is sent in the background. While the one before is still on its way a strict one waits for it, no longer
    than ``limit`` seconds, another one is left out: the next comes soon. By a simulator's clock each is sent before
    ``send`` returns, so that it arrives at the time at which it was given. ``strict`` decides for all, if it is not
    None. ``remade`` is called when the connection has been lost and is wanted again.
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
        """The port that it sends to."""
        return self._target

    @property
    def connected(self) -> bool:
        """Whether there is a connection, as far as is known."""
        return bool(self._port.outputs)

    def reconnect(self) -> None:
        """Connect; anew if there is a connection. Raises MiddlewareError."""
        self._port.add_output(self._target, self._carrier)

    def disconnect(self) -> None:
        """Hang up; the next use makes a new connection."""
        self._port.remove_output(self._target.name)

    def close(self) -> None:
        """Disconnect, when what was given is sent."""
        self._port.close()

    def send(self, head: list[Value], values: FloatArray, *, strict: bool) -> None:
        """Send a command and its values. Raises NoAnswerError when there is nobody to send to, or it takes too long."""
        port = self._port
        if not port.outputs:
            self._remade()
        if self._strict is not None:
            strict = self._strict
        if strict:
            self._drain()
        if not port.write(Pair(Bottle.adopt(head), values)) and strict:
            raise NoAnswerError(f"the connection with {self._target.name} broke: what was streamed is lost")
        if type(clock.current()) is not clock.SystemClock:
            self._drain()

    def _drain(self) -> None:
        if not self._port.wait(self._limit):
            raise NoAnswerError(f"{self.board} has not taken the command before within {self._limit:g} s")
