"""Calls and messages that people type and read, checked by an interface file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf import idl
from rtf.bottle import Bottle, BottleError
from rtf.errors import RtfError, did_you_mean
from rtf.middleware.types.record import FAILED, Record, read_call

if TYPE_CHECKING:
    from rtf.idl.service import RemoteFunction


class TypedCalls:
    """The functions of all services of a file. ``names`` are for the completion of what is typed."""

    def __init__(self, path: str) -> None:
        found = vars(idl.load(path)).values()
        self._functions: dict[str, RemoteFunction] = {}
        for one in found:
            if isinstance(one, type) and issubclass(one, idl.Service):
                self._functions |= one.FUNCTIONS
        self.names = sorted(self._functions)

    def request(self, words: Bottle) -> tuple[RemoteFunction | None, Bottle | Record]:
        """Return the function that is called and its message, whose numbers have the types of the arguments.

        What is no function is sent as it is, if it is ``help``. Raises RtfError, which says what the call would be.
        """
        called = read_call(words, self._functions)
        if called is None:
            first = str(words.get(0, ""))
            if first == "help":
                return None, words
            raise RtfError(f"there is no function {first}{did_you_mean(first, self.names)}; 'help' lists them")
        function = self._functions[called[0]]
        try:
            return function, function.request(function.values(called[1].elements()))
        except BottleError as error:
            raise RtfError(f"{error}; the call is {function.prototype}") from None

    @staticmethod
    def shown(function: RemoteFunction | None, reply: Bottle) -> str:
        """Return a reply as text: a result as Python writes it. Raises RtfError for one of another type."""
        if function is None or function.returns is None:
            return reply.to_text()
        if reply == Bottle([FAILED]) and function.returns is not idl.BOOL:
            raise RtfError(f"refused: the server does not know {function.prototype}, or not with these arguments")
        try:
            return repr(function.result(reply))
        except BottleError as error:
            raise RtfError(f"the reply {reply.to_text()} is of another type: {error}") from None


def message_type(path: str) -> type[idl.Message]:
    """Return the structure of ``FILE:NAME``, or that of a file that has only one. Raises IdlError and RtfError."""
    file, _, name = path.partition(":")
    found = {
        one.__name__: one
        for one in vars(idl.load(file)).values()
        if isinstance(one, type) and issubclass(one, idl.Message)
    }
    if not name and len(found) == 1:
        (name,) = found
    if name not in found:
        raise RtfError(f"{file} has {', '.join(sorted(found)) or 'no structures'}; choose one: {file}:NAME")
    return found[name]
