"""The RPC connection to a board of YARP 4.0: functions of a service instead of words."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, Any

from rtf.bottle import Bottle, BottleError
from rtf.errors import RtfError
from rtf.middleware.types import call
from rtf.middleware.types.service import succeeded
from rtf.robot.client.rpc import ACTION_LIMIT, BoardRpc
from rtf.robot.control_board_messages import BY_NAME, INTERFACE_NAMES
from rtf.robot.errors import NoAnswerError, NotSupportedError, RefusedError, RobotError, StaleStateError
from rtf.robot.return_value import ReturnValue
from rtf.robot.service_kinds import read_all, write_all

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.bottle import Value
    from rtf.middleware.ports.network import Network
    from rtf.middleware.ports.rpc import RpcClient
    from rtf.robot.client.board_requests import Request
    from rtf.robot.service_rows import Message

_AXES = BY_NAME["getAxesRPC"]
_INTERFACES = BY_NAME["getDeviceInterfacesRPC"]
_SHOWN = 120


class ServiceRpc(BoardRpc):
    """An RPC connection whose requests are functions; ``interfaces`` are those that the board has."""

    ends = ("nwc/rpc:o", "nws/rpc:i")

    def __init__(self, local: str, board: str, *, network: Network, limit: float, remade: Callable[[], None]) -> None:
        super().__init__(local, board, network=network, limit=limit, remade=remade)
        self.interfaces: dict[str, bool] = {}

    def check_protocol(self, *, ignore: bool) -> None:
        """Check that the board offers the service. Raises NotSupportedError unless ``ignore`` is set."""
        try:
            self.interfaces = self._call(self._port, _INTERFACES, (), self._limit)
        except (NotSupportedError, RefusedError) as error:
            if not ignore:
                raise NotSupportedError(
                    f"{self.board} does not list its interfaces, as boards of YARP 4.0 do: {error}; "
                    "set ignoreProtocolCheck to try it anyway"
                ) from None

    def get_at_once(self, request: Request) -> list[Value]:  # noqa: ARG002 - it is always the same one
        """Return the number of axes, without reconnecting."""
        return [self._call(self._port, _AXES, (), self._limit)]

    def call(self, message: Message, *arguments: object) -> Any:
        """Call a function and return its result: None, one value, or a tuple of several.

        Raises RefusedError if the board refuses, NotSupportedError if it does not have the function, StaleStateError
        and NoAnswerError if the board reports them, and NoAnswerError if the reply is late or invalid.
        """
        if not self._port.outputs:
            self._remade()
        return self._call(self._port, message, arguments, self._limit)

    def call_slowly(self, message: Message, *arguments: object) -> Any:
        """Call a function that takes long, over a separate connection, so that other requests are not blocked."""
        with self._port_of_its_own() as port:
            return self._call(port, message, arguments, ACTION_LIMIT)

    def _call(self, port: RpcClient, message: Message, arguments: tuple[object, ...], limit: float) -> Any:
        try:
            request = call(message.name, *write_all(message.takes, arguments))
            answer = port.call(request, timeout=limit)
        except RtfError as error:
            raise NoAnswerError(f"{self.board} did not answer {_asked(message, arguments)}: {error}") from error
        elements = answer.elements() if answer is not None else []
        if not elements:
            asked = _asked(message, arguments)
            raise NoAnswerError(f"{self.board} answered {asked} with an empty message")
        if not succeeded(elements):
            raise NotSupportedError(f"{self.board} does not know {_asked(message, arguments)}")
        try:
            code = ReturnValue.of(elements[0])
            if code is ReturnValue.OK:
                return _results(message, elements)
        except (BottleError, RefusedError) as error:
            asked, shown = _asked(message, arguments), Bottle.adopt(elements).to_text()[:_SHOWN]
            raise NoAnswerError(f"{self.board} answered {asked} with {shown!r}, which is not valid: {error}") from None
        raise self._error(message, code, _asked(message, arguments))

    def _error(self, message: Message, code: ReturnValue, asked: str) -> RobotError:
        """Return the error of a code."""
        interface = INTERFACE_NAMES.get(message.interface) if message.interface else None
        if code is ReturnValue.NOT_IMPLEMENTED or not self.interfaces.get(interface or "", True):
            return NotSupportedError(f"{self.board} does not have {asked}")
        if code is ReturnValue.NOT_READY:
            return StaleStateError(f"{self.board} is not ready for {asked}")
        if code is ReturnValue.COMMUNICATION:
            return NoAnswerError(f"{self.board} has no connection to the device of {asked}")
        return RefusedError(f"{self.board} refused {asked} ({code.name.lower().replace('_', ' ')})")


def _asked(message: Message, arguments: tuple[object, ...]) -> str:
    """Return a call as text for a message."""
    return f"{message.name}({', '.join(map(_shown, arguments))})"[:_SHOWN]


def _shown(argument: object) -> str:
    """Return an argument as text for a message: modes by their names."""
    if isinstance(argument, (list, tuple)):
        return f"[{', '.join(map(_shown, argument))}]"
    return argument.name if isinstance(argument, Enum) else str(argument)


def _results(message: Message, answer: list[Value]) -> Any:
    found = read_all(message.gives, answer[1:])
    if not found:
        return None
    return found[0] if len(found) == 1 else tuple(found)
