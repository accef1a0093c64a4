"""Functions of a service: the rows of its table, which map them to methods of a device, and calls by a client."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any

from rtf.bottle import Bottle, BottleError
from rtf.middleware.types import call as request
from rtf.middleware.types.service import succeeded
from rtf.robot.errors import NoAnswerError, NotSupportedError, RefusedError
from rtf.robot.yarp4.values import AXES, AXIS, Kind, ReturnValue, read_all, write_all

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.bottle import Value
    from rtf.middleware.types import Record
    from rtf.robot.errors import RobotError

_SHOWN = 120


class Style(Enum):
    """The relation between the arguments of function and method. A method with axes is three functions."""

    CALL = "as they are"
    ONE = "one axis"
    SOME = "several axes"
    ALL = "no axes: all of them"
    OWN = "something of its own"


@dataclass(frozen=True, slots=True)
class Message:
    """A function of the service. ``run`` calls a device; a result with several kinds in ``gives`` is a tuple.

    ``interface`` is None for a function that no device here implements.
    """

    name: str
    interface: type[Any] | None
    method: str
    style: Style
    takes: tuple[Kind, ...]
    gives: tuple[Kind, ...]
    run: Callable[..., Any]


def call(
    name: str,
    interface: type[Any],
    method: str,
    *,
    takes: tuple[Kind, ...] = (),
    gives: tuple[Kind, ...] = (),
    style: Style = Style.CALL,
) -> Message:
    """Return a function with the same arguments as the method."""

    def run(board: Any, *arguments: Any) -> Any:
        return getattr(board, method)(*arguments)

    return Message(name, interface, method, style, takes, gives, run)


def one(name: str, interface: type[Any], method: str, kind: Kind, *, of: tuple[Kind, ...] = (AXIS,)) -> Message:
    """Return a function that reads one axis."""

    def run(board: Any, *which: Any) -> Any:
        return getattr(board, method)(*which)[0]

    return Message(name, interface, method, Style.ONE, of, (kind,), run)


def some(name: str, interface: type[Any], method: str, kinds: Kind) -> Message:
    """Return a function that reads several axes."""
    return call(name, interface, method, takes=(AXES,), gives=(kinds,), style=Style.SOME)


def every(name: str, interface: type[Any], method: str, kinds: Kind, *, of: tuple[Kind, ...] = ()) -> Message:
    """Return a function that reads all axes."""
    return call(name, interface, method, takes=of, gives=(kinds,), style=Style.ALL)


def set_one(name: str, interface: type[Any], method: str, kind: Kind, *, of: tuple[Kind, ...] = (AXIS,)) -> Message:
    """Return a function that sets one axis. Its axis argument is before the value, that of the method after it."""
    return _set_axes(name, interface, method, Style.ONE, (*of, kind))


def set_some(name: str, interface: type[Any], method: str, kinds: Kind) -> Message:
    """Return a function that sets several axes. Its axes are before the values."""
    return _set_axes(name, interface, method, Style.SOME, (AXES, kinds))


def _set_axes(name: str, interface: type[Any], method: str, style: Style, takes: tuple[Kind, ...]) -> Message:
    def run(board: Any, *arguments: Any) -> None:
        *before, axes, values = arguments
        getattr(board, method)(*before, values, axes)

    return Message(name, interface, method, style, takes, (), run)


def set_every(name: str, interface: type[Any], method: str, kinds: Kind, *, of: tuple[Kind, ...] = ()) -> Message:
    """Return a function that sets all axes."""
    return call(name, interface, method, takes=(*of, kinds), style=Style.ALL)


def own(
    name: str,
    interface: type[Any],
    run: Callable[..., Any],
    *,
    takes: tuple[Kind, ...] = (),
    gives: tuple[Kind, ...] = (),
) -> Message:
    """Return a function with code of its own."""
    return Message(name, interface, "", Style.OWN, takes, gives, run)


def absent(name: str, *, takes: tuple[Kind, ...] = (), gives: tuple[Kind, ...] = ()) -> Message:
    """Return a function that no device here implements."""

    def run(board: object, *_arguments: Any) -> None:
        raise NotSupportedError(f"{type(board).__name__} does not have {name}")

    return Message(name, None, "", Style.OWN, takes, gives, run)


# Calls ----------------------------------------------------------------------------------------------------------------


def request_of(message: Message, arguments: tuple[object, ...]) -> Record:
    """Return the request of a call."""
    return request(message.name, *write_all(message.takes, arguments))


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


def refusal(device: str, code: ReturnValue, what: str) -> RefusedError:
    """Return the error of the call ``what`` that was refused, with the code as the reason."""
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
