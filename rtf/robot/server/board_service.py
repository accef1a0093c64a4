"""Answers what clients of YARP 4.0 ask of a control board, whatever the port is that they ask at."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any

from rtf.middleware.types import Function, ProtocolVersion, Service
from rtf.robot.control_board_messages import MESSAGES
from rtf.robot.errors import NoAnswerError, NotSupportedError, RefusedError, RobotError, StaleStateError
from rtf.robot.return_value import ReturnValue
from rtf.robot.service_kinds import read_all, write_all

if TYPE_CHECKING:
    from rtf.bottle import Bottle, Value
    from rtf.middleware.network import Network
    from rtf.robot.service_rows import Message

#: The version of the service, and the release whose service it is.
VERSION = ProtocolVersion(0, 4, 0, 0)


class BoardService:
    """The functions of a board. ``answer`` is what an RPC server does with a question, in whatever thread.

    What the device raises becomes the code of the answer; an error that is none of a robot's is reported, too.
    """

    def __init__(self, device: object, name: str, *, network: Network) -> None:
        self._device = device
        self._name = name
        self._network = network
        functions = {message.name: Function(partial(self._run, message), message.prototype) for message in MESSAGES}
        self._service = Service(functions)
        self._version = Service({"getRemoteProtocolVersion": Function(lambda: VERSION)})

    def answer(self, question: Bottle) -> object:
        """What is answered; ``[fail]`` for a function that there is not, or arguments of other kinds."""
        if question and question[0] == "getRemoteProtocolVersion":  # not among the functions that ``help`` tells of
            return self._version.answer(question)
        return self._service.answer(question)

    def _run(self, message: Message, *elements: Value) -> object:
        """What a function answers: how it went, and the results. Raises BottleError for arguments of other kinds."""
        try:
            arguments = read_all(message.takes, elements)
        except RefusedError:
            return _failed(message, ReturnValue.METHOD_FAILED)
        missing = message.interface is not None and not isinstance(self._device, message.interface)
        if missing or not all(map(_finite, arguments)):
            return _failed(message, ReturnValue.METHOD_FAILED)  # of a missing interface YARP's servers say this, too
        try:
            return _succeeded(message, message.run(self._device, *arguments))
        except RobotError as error:
            return _failed(message, _code_of(error))
        except Exception as error:  # noqa: BLE001 - whatever a driver does, the port goes on, and it is told
            self._network.report(f"{self._name}: {message.name} failed: {type(error).__name__}: {error}")
            return _failed(message, ReturnValue.GENERIC)


def _succeeded(message: Message, found: Any) -> object:
    """The answer with what a method has given, which is of as many kinds as there are."""
    if not message.gives:
        return ReturnValue.OK
    return (ReturnValue.OK, *write_all(message.gives, [*found] if len(message.gives) > 1 else [found]))


def _failed(message: Message, code: ReturnValue) -> object:
    """The answer that has nothing to tell; its reader finds as much in it as always."""
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
    """Whether it has no number that is infinite or none: such a one moves no robot."""
    if isinstance(argument, (list, tuple)):
        return all(map(_finite, argument))
    return not isinstance(argument, float) or math.isfinite(argument)
