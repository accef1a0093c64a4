"""A call of a service function over the network: the request, and the interpretation of the answer."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, Any

from rtf.bottle import Bottle, BottleError
from rtf.middleware.types import call
from rtf.middleware.types.service import succeeded
from rtf.robot.errors import NoAnswerError, NotSupportedError, RefusedError
from rtf.robot.return_value import ReturnValue
from rtf.robot.service_kinds import read_all, write_all

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.bottle import Value
    from rtf.middleware.types import Record
    from rtf.robot.errors import RobotError
    from rtf.robot.service_rows import Message

_SHOWN = 120


def request_of(message: Message, arguments: tuple[object, ...]) -> Record:
    """Return the request of a call."""
    return call(message.name, *write_all(message.takes, arguments))


def result_of(
    message: Message,
    arguments: tuple[object, ...],
    elements: list[Value],
    *,
    device: str,
    error_of: Callable[[ReturnValue, str], RobotError],
) -> Any:
    """Return the result in the elements of an answer: None, one value, or a tuple of several.

    ``device`` is the name for messages. ``error_of`` returns the error to raise for a code; its second argument is
    the call as text. Raises NotSupportedError for an unknown function, and NoAnswerError for an invalid answer.
    """
    if not elements:
        raise NoAnswerError(f"{device} answered {asked(message, arguments)} with an empty message")
    if not succeeded(elements):
        raise NotSupportedError(f"{device} does not know {asked(message, arguments)}")
    try:
        code = ReturnValue.of(elements[0])
        if code is ReturnValue.OK:
            return _results(message, elements)
    except (BottleError, RefusedError) as error:
        what, shown = asked(message, arguments), Bottle.adopt(elements).to_text()[:_SHOWN]
        raise NoAnswerError(f"{device} answered {what} with {shown!r}, which is not valid: {error}") from None
    raise error_of(code, asked(message, arguments))


def asked(message: Message, arguments: tuple[object, ...]) -> str:
    """Return a call as text for a message."""
    return f"{message.name}({', '.join(map(_shown, arguments))})"[:_SHOWN]


def refusal(device: str, what: str, code: ReturnValue) -> RefusedError:
    """Return the error of a call that was refused, with the code as the reason."""
    return RefusedError(f"{device} refused {what} ({code.name.lower().replace('_', ' ')})")


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
