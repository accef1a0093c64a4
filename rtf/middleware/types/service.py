"""Services: functions that are called by name in records, and their help texts."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, BottleError, Vocab
from rtf.middleware.types.record import FAILED, FunctionNames, Record, read_call

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from rtf.bottle import Value

_MANY = Vocab("many")
#: The answer to a call that is not understood.
FAIL = Bottle([FAILED])


@dataclass(frozen=True, slots=True)
class Function:
    """A function of a service: the callable, its prototype, and the lines of its help text."""

    run: Callable[..., object]
    prototype: str = ""
    help: tuple[str, ...] = ()


class Service:
    """A service: functions by name. ``answer`` is the handler of an RPC server.

    A function is called with the elements of the request. Its return value is the answer: None for an empty answer, a
    tuple for a structure, any other value for itself; an object with a codec is sent as it is. ``help`` is answered
    unless a function has that name.
    """

    def __init__(self, functions: Mapping[str, Function]) -> None:
        self._functions = dict(functions)
        self._names = FunctionNames(functions)
        signatures = {name: inspect.signature(function.run) for name, function in functions.items()}
        #: Those that do not take any number of arguments.
        self._signatures = {
            name: one
            for name, one in signatures.items()
            if not any(parameter.kind is parameter.VAR_POSITIONAL for parameter in one.parameters.values())
        }

    def answer(self, request: Bottle) -> object:
        """Return the answer to a call; :data:`FAIL` for an unknown function or a wrong number of arguments.

        A function raises BottleError for an argument of the wrong type. Other errors are not caught.
        """
        called = self._names.read(request)
        if called is None:
            return self._help(request)
        name, arguments = called
        signature = self._signatures.get(name)
        if signature is not None:
            try:
                signature.bind(*arguments)
            except TypeError:  # more arguments or fewer than the function takes
                return FAIL
        try:
            return answer(self._functions[name].run(*arguments))
        except BottleError:
            return FAIL

    def _help(self, request: Bottle) -> object:
        called = read_call(request, ("help",))
        if called is None:
            return FAIL
        if not called[1]:
            return help_answer(["*** Available commands:", *self._functions, "help"])
        asked = self._names.read(called[1])
        if asked is None:
            return FAIL
        function = self._functions[asked[0]]
        return help_answer([function.prototype or asked[0], *function.help])


def answer(returned: object) -> object:
    """Return the answer for a function's return value: a record, unless the value has a codec."""
    if isinstance(returned, Bottle) or hasattr(returned, "codec"):
        return returned
    return Record() if returned is None else Record(returned)


def help_answer(lines: Iterable[str]) -> Record:
    """Return the answer for a text of several lines, which tools print one per line."""
    return Record(_MANY, Record(*lines))


def succeeded(reply: Sequence[Value]) -> bool:
    """Return whether an answer does not begin with ``[fail]``, which means an unknown or failed function."""
    return not (len(reply) and reply[0] == FAILED)
