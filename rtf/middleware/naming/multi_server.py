"""A name service of several servers: ports are registered with all, and the first server that knows a name answers."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from rtf.middleware.errors import ConnectError, MiddlewareError
from rtf.middleware.ports.names import Names

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.middleware.wire.contact import Contact

T = TypeVar("T")


class MultiServerNames(Names):
    """The name service of several servers. The first one assigns addresses; the others get a copy of them.

    Queries work while a server is down, but a registration needs all of them.
    """

    def __init__(self, all_names: Sequence[Names]) -> None:
        self._all = tuple(all_names)

    def register(self, name: str, *, carrier: str = "", host: str = "", port: int = 0, promise: str = "") -> Contact:
        first, *others = self._all
        contact = first.register(name, carrier=carrier, host=host, port=port, promise=promise)
        done = [first]
        try:
            for names in others:
                where = {"carrier": contact.carrier, "host": contact.host}
                names.register(contact.name, **where, port=contact.port, promise=promise)
                done.append(names)
        except MiddlewareError:
            _each(done, lambda names: names.unregister(contact.name))
            raise
        return contact

    def unregister(self, name: str) -> None:
        _each(self._all, lambda names: names.unregister(name))

    def query(self, name: str) -> Contact | None:
        return self._first(lambda names: names.query(name))

    def list(self, prefix: str = "") -> Sequence[Contact]:
        """Return the ports of all servers; a name that several know is listed once."""
        found = {contact.name: contact for names in reversed(self._all) for contact in names.list(prefix)}
        return [found[name] for name in sorted(found)]

    def set_property(self, name: str, key: str, values: Sequence[str]) -> None:
        _each(self._all, lambda names: names.set_property(name, key, values))

    def get_property(self, name: str, key: str) -> Sequence[str]:
        return self._first(lambda names: names.get_property(name, key)) or ()

    def announce(self, name: str, *, active: bool = True) -> None:
        _each(self._all, lambda names: names.announce(name, active=active))

    def command(self, line: str) -> Sequence[str]:
        """Execute a command on the first server only."""
        return self._all[0].command(line)

    def close(self) -> None:
        _each(self._all, lambda names: names.close())

    def _first(self, ask: Callable[[Names], T]) -> T | None:
        """Return the first answer that is not empty.

        If all are empty, the error of a server that is down is raised, if there is one.
        """
        failure: ConnectError | None = None
        for names in self._all:
            try:
                answer = ask(names)
            except ConnectError as error:
                failure = failure or error
            else:
                if answer:
                    return answer
        if failure is not None:
            raise failure
        return None


def _each(all_names: Sequence[Names], do: Callable[[Names], None]) -> None:
    """Call ``do`` for all servers, despite errors. Raises the first error afterwards."""
    failure: MiddlewareError | None = None
    for names in all_names:
        try:
            do(names)
        except MiddlewareError as error:
            failure = failure or error
    if failure is not None:
        raise failure
