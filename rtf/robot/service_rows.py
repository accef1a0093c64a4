"""The rows of the table of a service: a function, and how it becomes a call of a method of a device."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any

from rtf.robot.errors import NotSupportedError
from rtf.robot.service_kinds import AXES, AXIS, Kind

if TYPE_CHECKING:
    from collections.abc import Callable


class Style(Enum):
    """How a function's arguments are those of the method: plural methods are three functions each."""

    CALL = "as they are"
    ONE = "one axis"
    SOME = "several axes"
    ALL = "no axes: all of them"
    OWN = "something of its own"


@dataclass(frozen=True, slots=True)
class Message:
    """A function of the service. ``run`` does it on a device; its result is what ``gives`` says, in a tuple if several.

    ``interface`` is None for what no device here can do.
    """

    name: str
    interface: type[Any] | None
    method: str
    style: Style
    takes: tuple[Kind, ...]
    gives: tuple[Kind, ...]
    run: Callable[..., Any]

    @property
    def prototype(self) -> str:
        """What a tool shows of it."""
        result = (
            f"return_{_RESULTS.get(self.name, self.name.removesuffix('RPC'))}"
            if self.gives
            else "yarp::dev::ReturnValue"
        )
        constant = " const" if self.gives and self.name not in _CHANGING else ""
        arguments = ", ".join(kind.cpp for kind in self.takes)
        return f"{result} ControlBoardMsgs::{self.name}({arguments}){constant}"


#: Results that are not called like their function.
_RESULTS = {
    "getInteractionModesGroupRPC": "getInteractionModeGroup",
    "getInteractionModesAllRPC": "getInteractionModeAll",
    "getMotorEncodersTimedAllRPC": "getMotorEncoderTimedAll",
}
#: Functions that read but are not declared so.
_CHANGING = frozenset({"getAxisNameRPC", "getJointTypeRPC", "getMotorTorqueParamsRPC"})


def call(
    name: str,
    interface: type[Any],
    method: str,
    *,
    takes: tuple[Kind, ...] = (),
    gives: tuple[Kind, ...] = (),
    style: Style = Style.CALL,
) -> Message:
    """The arguments of the function are those of the method."""

    def run(board: Any, *arguments: Any) -> Any:
        return getattr(board, method)(*arguments)

    return Message(name, interface, method, style, takes, gives, run)


def one(name: str, interface: type[Any], method: str, kind: Kind, *, of: tuple[Kind, ...] = (AXIS,)) -> Message:
    """Read one axis."""

    def run(board: Any, *which: Any) -> Any:
        return getattr(board, method)(*which)[0]

    return Message(name, interface, method, Style.ONE, of, (kind,), run)


def some(name: str, interface: type[Any], method: str, kinds: Kind) -> Message:
    """Read several axes."""
    return _reading(name, interface, method, Style.SOME, (AXES,), kinds)


def every(name: str, interface: type[Any], method: str, kinds: Kind, *, of: tuple[Kind, ...] = ()) -> Message:
    """Read all axes."""
    return _reading(name, interface, method, Style.ALL, of, kinds)


def _reading(
    name: str, interface: type[Any], method: str, style: Style, takes: tuple[Kind, ...], kinds: Kind
) -> Message:
    def run(board: Any, *which: Any) -> Any:
        return getattr(board, method)(*which)

    return Message(name, interface, method, style, takes, (kinds,), run)


def set_one(name: str, interface: type[Any], method: str, kind: Kind, *, of: tuple[Kind, ...] = (AXIS,)) -> Message:
    """Set one axis: in the function it stands before the value, in the method after it."""
    return _setting(name, interface, method, Style.ONE, of, kind)


def set_some(name: str, interface: type[Any], method: str, kinds: Kind) -> Message:
    """Set several axes; likewise."""
    return _setting(name, interface, method, Style.SOME, (AXES,), kinds)


def set_every(name: str, interface: type[Any], method: str, kinds: Kind, *, of: tuple[Kind, ...] = ()) -> Message:
    """Set all axes."""

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
    """Something that is made of the methods of an interface."""
    return Message(name, interface, "", Style.OWN, takes, gives, run)


def absent(name: str, *, takes: tuple[Kind, ...] = (), gives: tuple[Kind, ...] = ()) -> Message:
    """What no device here can do."""

    def run(board: object, *_arguments: Any) -> None:
        raise NotSupportedError(f"{type(board).__name__} does not know {name}")

    return Message(name, None, "", Style.OWN, takes, gives, run)
