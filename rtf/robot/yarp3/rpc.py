"""The RPC connection of a client to a board of YARP 3, and the interpretation of the replies."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rtf.bottle import Bottle, Value
from rtf.errors import RtfError
from rtf.robot.errors import NoAnswerError, NotSupportedError, RefusedError
from rtf.robot.network.board_link import ACTION_LIMIT, BoardRpc
from rtf.robot.yarp3.requests import GETTING, PROTOCOL, REQUEST, plain
from rtf.robot.yarp3.table import FAIL, IS, NAK, OK, PROTOCOL_VERSION, Shape
from rtf.robot.yarp3.table import PROTOCOL as VERSION

if TYPE_CHECKING:
    from rtf.middleware.ports.rpc import RpcClient
    from rtf.robot.yarp3.requests import FilledRequest, Request

_SHOWN = 120
_PROTOCOL_ANSWER = 5
_AXES = GETTING["axes"][Shape.NONE]


class WordRpc(BoardRpc):
    """An RPC connection whose requests are words."""

    ends = ("rpc:o", "rpc:i")

    # Requests ----------------------------------------------------------------------------------------------------

    def get(self, request: Request, *arguments: Value) -> list[Value]:
        """Send a request and return the data of the answer.

        Raises RefusedError, NotSupportedError and NoAnswerError, as ``command`` does.
        """
        return self._data(request, arguments, self._ask(self._port, request, arguments, self._limit))

    def _data(self, request: Request, arguments: tuple[Value, ...], answer: list[Value]) -> list[Value]:
        """Return the data of an answer. Raises NoAnswerError for an invalid one."""
        head, first, end, last = request.head, answer[0], answer[-1], len(answer) - request.tail
        # Words are usually the same objects, and an identity check costs a tenth of a comparison.
        if last < head or (end is not OK and end != OK) or (head and first is not IS and first != IS):
            raise self.nonsense(request, arguments, answer)
        return answer[head:last]

    def read(self, request: Request, *arguments: Value) -> Any:
        """Send a request and return the decoded data: one value, or a tuple of several. Errors as for ``get``."""
        data = self.get(request, *arguments)
        try:
            values = request.kind.read(data)
        except RefusedError as error:
            raise self.nonsense(request, arguments, data, str(error)) from None
        return values[0] if len(values) == 1 else values

    def command(self, request: Request, *arguments: Value) -> None:
        """Send a command.

        Raises RefusedError if the board refuses, NotSupportedError if it does not know the command, NoAnswerError if
        the reply is late or invalid.
        """
        self._command(self._port, request, arguments, self._limit)

    def act(self, request: Request, *arguments: Value) -> None:
        """Send a command that takes long, over a separate connection, so that other requests are not blocked.

        The reply comes when the command is done, within :data:`ACTION_LIMIT`.
        """
        with self.separate_port() as port:
            self._command(port, request, arguments, ACTION_LIMIT)

    def _command(self, port: RpcClient, request: Request, arguments: tuple[Value, ...], limit: float) -> None:
        answer = self._ask(port, request, arguments, limit)
        if answer[0] is not OK and answer[0] != OK:
            raise self.nonsense(request, arguments, answer)

    def check_protocol(self, *, ignore: bool) -> None:
        try:
            answer = self._ask(self._port, PROTOCOL, (), self._limit, again=False)
        except (RefusedError, NotSupportedError):
            answer = []
        known = len(answer) == _PROTOCOL_ANSWER and answer[0] == PROTOCOL_VERSION and answer[-1] == OK
        if ignore or (known and answer[1:3] == [*VERSION[:2]]):
            return
        raise NotSupportedError(
            f"{self.board} does not speak version {VERSION[0]}.{VERSION[1]} of the protocol of control boards but "
            f"answers {_shown(answer)}; set ignoreProtocolCheck to try it anyway"
        )

    def count_axes(self) -> int:
        axes = self._data(_AXES, (), self._ask(self._port, _AXES, (), self._limit, again=False))
        if len(axes) != 1 or not isinstance(axes[0], int):
            raise self.nonsense(_AXES, (), axes, "a number of joints is needed")
        return axes[0]

    def _ask(
        self, port: RpcClient, request: Request, arguments: tuple[Value, ...], limit: float, *, again: bool = True
    ) -> list[Value]:
        """Send a request and return the elements of the answer, at least one. Raises the error of a failure."""
        if again and not port.outputs:
            self._remade()
        asked = request, arguments
        try:
            answer = port.call(asked, codec=REQUEST, timeout=limit)
        except RtfError as error:
            raise NoAnswerError(f"{self.board} did not answer {_text(asked)}: {error}") from error
        elements = answer.elements() if answer is not None else []
        if not elements:
            raise NoAnswerError(f"{self.board} answered {_text(asked)} with an empty message")
        first = elements[0]
        if first is IS or first is OK:  # the usual case
            return elements
        if first == FAIL:
            raise RefusedError(f"{self.board} refused {_text(asked)}{_joints(arguments)}")
        if first == NAK:
            raise NotSupportedError(f"{self.board} does not know what {_text(asked)} means")
        return elements

    def nonsense(
        self, request: Request, arguments: tuple[Value, ...], answer: list[Value], why: str = ""
    ) -> NoAnswerError:
        """Return the error for an invalid answer."""
        reason = f": {why}" if why else ""
        asked = _text((request, arguments))
        return NoAnswerError(f"{self.board} answered {asked} with {_shown(answer)}, which is not valid{reason}")


def _joints(arguments: tuple[Value, ...]) -> str:
    """Return the joints of a request, for a message; empty if it is for all of them, or none."""
    for place, argument in enumerate(arguments):
        if type(argument) is int:
            group = arguments[place + 1] if place + 1 < len(arguments) else None
            return f", joints {group.to_text()}" if isinstance(group, Bottle) else f", joint {argument}"
    return ""


def _text(asked: FilledRequest) -> str:
    """Return a request as text for a message."""
    return _shown(plain(asked).elements())


def _shown(elements: list[Value]) -> str:
    """Return an answer as text for a message."""
    text = Bottle.adopt(elements).to_text()
    return f"'{text[:_SHOWN]}{'…' if len(text) > _SHOWN else ''}'"
