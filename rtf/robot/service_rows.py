"""The rows of a service table: functions, and their mapping to methods of a device."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any

from rtf.robot.errors import NotSupportedError
from rtf.robot.service_kinds import AXES, AXIS, Kind

if TYPE_CHECKING:
    from collections.abc import Callable


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
    return _reading(name, interface, method, Style.SOME, (AXES,), kinds)


def every(name: str, interface: type[Any], method: str, kinds: Kind, *, of: tuple[Kind, ...] = ()) -> Message:
    """Return a function that reads all axes."""
    return _reading(name, interface, method, Style.ALL, of, kinds)


def _reading(
    name: str, interface: type[Any], method: str, style: Style, takes: tuple[Kind, ...], kinds: Kind
) -> Message:
    def run(board: Any, *which: Any) -> Any:
        return getattr(board, method)(*which)

    return Message(name, interface, method, style, takes, (kinds,), run)


def set_one(name: str, interface: type[Any], method: str, kind: Kind, *, of: tuple[Kind, ...] = (AXIS,)) -> Message:
    """Return a function that sets one axis. Its axis argument is before the value, that of the method after it."""
    return _setting(name, interface, method, Style.ONE, of, kind)


def set_some(name: str, interface: type[Any], method: str, kinds: Kind) -> Message:
    """Return a function that sets several axes. Its axes are before the values."""
    return _setting(name, interface, method, Style.SOME, (AXES,), kinds)


def set_every(name: str, interface: type[Any], method: str, kinds: Kind, *, of: tuple[Kind, ...] = ()) -> Message:
    """Return a function that sets all axes."""

    def run(board: Any, *arguments: Any) -> None:
        getattr(board, method)(*arguments)

    return Message(name, interface, method, Style.ALL, (*of, kinds), (), run)


def _setting(name: str, interface: type[Any], method: str, style: Style, of: tuple[Kind, ...], kind: Kind) -> Message:
    def run(board: Any, *arguments: Any) -> None:
        *before, axes, values = arguments
        getattr(board, method)(*before, values, axes)

    return Message(name, interface, method, style, (*of, kind), (), run)


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
