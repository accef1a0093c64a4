"""Services: functions that are called by name in records, and the help that tools show of them."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, BottleError, Vocab
from rtf.middleware.types.record import FAILED, Record, read_call

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from rtf.bottle import Value

_MANY = Vocab("many")
#: What is answered to a call that is not understood.
FAIL = Bottle([FAILED])


@dataclass(frozen=True, slots=True)
class Function:
    """A function of a service: what is called with the values of the arguments, and what ``help`` says of it."""

    run: Callable[..., object]
    prototype: str = ""
    help: tuple[str, ...] = ()


class Service:
    """Functions by name. ``answer`` is what an RPC server does with a question.

    A function is called with the elements of the request, and what it returns is the answer: None for nothing, a tuple
    for a structure, anything else for itself; an object with a codec of its own is the answer itself.
    ``help`` is answered if no function is called so.
    """

    def __init__(self, functions: Mapping[str, Function]) -> None:
        self._functions = dict(functions)
        self._signatures = {name: inspect.signature(function.run) for name, function in functions.items()}

    def answer(self, request: Bottle) -> object:
        """The answer to a call; :data:`FAIL` if there is no such function, or if it takes other arguments.

        That an argument is of the wrong kind a function says by raising BottleError. Other errors are the service's
        own and are not caught.
        """
        called = read_call(request, self._functions)
        if called is None:
            return self._help(request)
        name, arguments = called
        try:
            self._signatures[name].bind(*arguments)
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
        asked = read_call(called[1], self._functions)
        if asked is None:
            return FAIL
        function = self._functions[asked[0]]
        return help_answer([function.prototype or asked[0], *function.help])


def answer(returned: object) -> object:
    """What is sent for what a function returned: a record, unless the object knows by itself how it is written."""
    if isinstance(returned, Bottle) or hasattr(returned, "codec"):
        return returned
    return Record() if returned is None else Record(returned)


def help_answer(lines: Iterable[str]) -> Record:
    """Text of several lines, which tools print one below the other."""
    return Record(_MANY, Record(*lines))


def succeeded(reply: Sequence[Value]) -> bool:
    """Whether an answer does not begin with ``[fail]``, the answer of a function that is not there or did not work."""
    return not (len(reply) and reply[0] == FAILED)
