"""The services of YARP 4's devices: answers to calls of their functions, independent of the port."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from rtf.bottle import BottleError
from rtf.middleware.types import Function, ProtocolVersion, Service
from rtf.middleware.types.service import FAIL
from rtf.middleware.types.service import answer as answered
from rtf.robot.errors import NoAnswerError, NotSupportedError, RefusedError, RobotError, StaleStateError
from rtf.robot.yarp4.table import MESSAGES, prototype
from rtf.robot.yarp4.values import ReturnValue, read_all, write_all

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from rtf.bottle import Bottle, Value
    from rtf.middleware.ports.network import Network
    from rtf.robot.yarp4.functions import Message

#: The version of the protocol, and the release that it belongs to.
VERSION = ProtocolVersion(0, 4, 0, 0)


class DeviceService:
    """The functions of a device. ``answer`` is the handler of an RPC server, and may be called in any thread.

    ``target`` returns the object that a function is called on, or None if the device lacks the interface, which is
    answered with the code ``missing``. ``prototype`` returns the text that tools show for a function. An error of the
    device becomes the code of the answer; one that is not a RobotError is reported, too.
    """

    def __init__(
        self,
        messages: Iterable[Message],
        target: Callable[[Message], object | None],
        name: str,
        *,
        prototype: Callable[[Message], str],
        missing: ReturnValue,
        network: Network,
    ) -> None:
        self._name = name
        self._network = network
        self._missing = missing
        rows = [*messages]
        self._runs = {message.name: self._running(message, target(message)) for message in rows}
        self._service = Service(
            {message.name: Function(self._runs[message.name], prototype(message)) for message in rows}
        )
        self._version = Service({"getRemoteProtocolVersion": Function(lambda: VERSION)})

    def answer(self, request: Bottle) -> object:
        """Answer a call; ``[fail]`` for an unknown function, or arguments of a wrong type."""
        elements = request.elements()
        name = elements[0] if elements else None
        run = self._runs.get(name) if isinstance(name, str) else None
        if run is not None:  # the form that programs use; matching words takes longer than all the rest
            try:
                return answered(run(*elements[1:]))
            except BottleError:
                return FAIL
        if name == "getRemoteProtocolVersion":  # not listed by ``help``
            return self._version.answer(request)
        return self._service.answer(request)

    def _running(self, message: Message, device: object | None) -> Callable[..., object]:
        """Return the implementation of a function, which returns the code and the results.

        It raises BottleError for arguments of a wrong type.
        """
        takes, run = message.takes, message.run

        def running(*elements: Value) -> object:
            try:
                arguments = read_all(takes, elements)
            except RefusedError:
                return _failed(message, ReturnValue.METHOD_FAILED)
            if device is None:
                return _failed(message, self._missing)
            if not all(map(_finite, arguments)):
                return _failed(message, ReturnValue.METHOD_FAILED)
            try:
                return _succeeded(message, run(device, *arguments))
            except RobotError as error:
                return _failed(message, _code_of(error))
            except Exception as error:  # noqa: BLE001 - the port must survive errors of a driver; they are reported
                self._network.report(f"{self._name}: {message.name} failed: {type(error).__name__}: {error}")
                return _failed(message, ReturnValue.GENERIC)

        return running


def _succeeded(message: Message, found: Any) -> object:
    """Return the answer with the results of a method."""
    if not message.gives:
        return ReturnValue.OK
    return (ReturnValue.OK, *write_all(message.gives, [*found] if len(message.gives) > 1 else [found]))


def _failed(message: Message, code: ReturnValue) -> object:
    """Return the answer of a failure, with default values for all results."""
    if not message.gives:
        return code
    return (code, *write_all(message.gives, [kind.default for kind in message.gives]))


def _code_of(error: RobotError) -> ReturnValue:
    if isinstance(error, NotSupportedError):
        return ReturnValue.NOT_IMPLEMENTED
    if isinstance(error, StaleStateError):
        return ReturnValue.NOT_READY
    if isinstance(error, NoAnswerError):
        return ReturnValue.COMMUNICATION
    return ReturnValue.METHOD_FAILED


def _finite(argument: object) -> bool:
    """Return whether all numbers are finite: no other may reach a robot."""
    if isinstance(argument, (list, tuple)):
        return all(map(_finite, argument))
    return not isinstance(argument, float) or math.isfinite(argument)


class BoardService(DeviceService):
    """The functions of a board, independent of the port."""

    def __init__(self, device: object, name: str, *, network: Network) -> None:
        def target(message: Message) -> object | None:
            return device if message.interface is None or isinstance(device, message.interface) else None

        super().__init__(
            MESSAGES,
            target,
            name,
            prototype=prototype,
            missing=ReturnValue.METHOD_FAILED,  # as YARP's boards answer
            network=network,
        )
