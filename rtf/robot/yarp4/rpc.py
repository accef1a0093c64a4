"""The RPC connection of a client to a board of YARP 4, whose requests are functions of a service."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from rtf.errors import RtfError
from rtf.robot.errors import NoAnswerError, NotSupportedError, RefusedError, RobotError, StaleStateError
from rtf.robot.network.board_link import ACTION_LIMIT, BoardRpc
from rtf.robot.yarp4.functions import asked, refusal, request_of, result_of
from rtf.robot.yarp4.table import BY_NAME, INTERFACE_NAMES
from rtf.robot.yarp4.values import ReturnValue

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.ports.network import Network
    from rtf.middleware.ports.rpc import RpcClient
    from rtf.robot.yarp4.functions import Message

_AXES = BY_NAME["getAxesRPC"]
_INTERFACES = BY_NAME["getDeviceInterfacesRPC"]


class ServiceRpc(BoardRpc):
    """An RPC connection whose requests are functions; ``interfaces`` are those that the board has."""

    ends = ("nwc/rpc:o", "nws/rpc:i")

    def __init__(self, local: str, board: str, *, network: Network, limit: float, remade: Callable[[], None]) -> None:
        super().__init__(local, board, network=network, limit=limit, remade=remade)
        self.interfaces: dict[str, bool] = {}

    def check_protocol(self, *, ignore: bool) -> None:
        try:
            self.interfaces = self._call(self._port, _INTERFACES, (), self._limit)
        except (NotSupportedError, RefusedError) as error:
            if not ignore:
                raise NotSupportedError(
                    f"{self.board} does not list its interfaces, as boards of YARP 4.0 do: {error}; "
                    "set ignoreProtocolCheck to try it anyway"
                ) from None

    def count_axes(self) -> int:
        return int(self._call(self._port, _AXES, (), self._limit))

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
        with self.separate_port() as port:
            return self._call(port, message, arguments, ACTION_LIMIT)

    def _call(self, port: RpcClient, message: Message, arguments: tuple[object, ...], limit: float) -> Any:
        try:
            answer = port.call(request_of(message, arguments), timeout=limit)
        except RtfError as error:
            raise NoAnswerError(f"{self.board} did not answer {asked(message, arguments)}: {error}") from error
        elements = answer.elements() if answer is not None else []
        return result_of(message, arguments, elements, device=self.board, error_of=partial(self._error, message))

    def _error(self, message: Message, code: ReturnValue, what: str) -> RobotError:
        """Return the error of a code."""
        interface = INTERFACE_NAMES.get(message.interface) if message.interface else None
        if code is ReturnValue.NOT_IMPLEMENTED or not self.interfaces.get(interface or "", True):
            return NotSupportedError(f"{self.board} does not have {what}")
        if code is ReturnValue.NOT_READY:
            return StaleStateError(f"{self.board} is not ready for {what}")
        if code is ReturnValue.COMMUNICATION:
            return NoAnswerError(f"{self.board} has no connection to the device of {what}")
        return refusal(self.board, code, what)
