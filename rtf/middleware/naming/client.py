"""Client of a name server, ours or YARP's.

As in every YARP program, each request has a connection of its own. Only the properties of a port that was registered
go through one connection, as a program may open a hundred ports.

Names survive a restart of the server: while ports are open, a thread checks periodically whether they are still
registered, see :mod:`rtf.middleware.naming.registration_keeper`.
"""

from __future__ import annotations

import contextlib
import os
from typing import TYPE_CHECKING, TypeAlias

from rtf import clock
from rtf.bottle import Bottle, to_string
from rtf.middleware.carriers import registry
from rtf.middleware.carriers.stream import open_stream
from rtf.middleware.errors import AddressError, ConnectError, MiddlewareError, NameServerError, ProtocolError
from rtf.middleware.naming.network_interfaces import own_addresses
from rtf.middleware.naming.registration_keeper import Record, RegistrationKeeper
from rtf.middleware.ports.names import Names
from rtf.middleware.wire.name_server_lines import PREFIX, command, read_registration, register_command

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.carriers.stream import Stream
    from rtf.middleware.wire.contact import Contact

#: An alias: within the class, ``list`` is a method.
Lines: TypeAlias = list[str]

#: The largest answer, in bytes; ten thousand ports need a tenth of it.
_MOST = 1 << 24
#: YARP's servers answer these commands, and all in ``bot`` form, with a single line.
_ONE_LINE = ("bot", "subscribe", "unsubscribe", "topic", "untopic", "type", "announce")
#: The line end of port commands of YARP's library; the commands of its tools end with a bare line feed.
_LIBRARY = "\r\n"


class RemoteNames(Names):
    """The name service of the server at ``contact``.

    ``patience`` is the timeout of a request in seconds, ``address`` the host under which ports are registered if the
    server shall not choose it, ``watch`` the period in seconds of the check that names are still registered, and
    ``key`` the shared key, if any.
    """

    def __init__(
        self, contact: Contact, *, patience: float = 5.0, address: str = "", watch: float = 2.0, key: bytes = b""
    ) -> None:
        self.contact = contact
        self._patience = patience
        self._address = address
        self._key = key
        self._keeper = RegistrationKeeper(self._find, self._restore, watch)

    def register(self, name: str, *, carrier: str = "", host: str = "", port: int = 0, promise: str = "") -> Contact:
        """Register a name, and tell the server the carriers and addresses of the port."""
        if carrier != "mcast" and not host and self._address:
            carrier, host = carrier or "tcp", self._address
        lines = self._ask(register_command(name, carrier, host, port, promise), _LIBRARY)
        contact = next(filter(None, map(read_registration, lines)), None)
        if contact is None:
            raise AddressError(
                f"the name server at {self._place} did not register {name or 'a port without a name'}, it said"
                f" {' / '.join(lines)!r}: a name has no blanks, and 'rtf clean' frees those that are gone"
            )
        record = Record(contact, promise, self._facts())
        self._note(record)
        self._keeper.keep(record)
        return contact

    @staticmethod
    def _facts() -> dict[str, Sequence[str]]:
        carriers = [name for name in registry.names() if "+" not in name]  # the others are variants
        return {"offers": carriers, "accepts": carriers, "ips": own_addresses(), "process": [str(os.getpid())]}

    def _note(self, record: Record) -> None:
        name = record.contact.name
        self._ask_all([command("set", name, key, *values) for key, values in record.properties.items()], _LIBRARY)

    def unregister(self, name: str) -> None:
        with self._keeper.forgetting(name):
            self._ask(command("unregister", name))

    def query(self, name: str) -> Contact | None:
        return next(filter(None, map(read_registration, self._ask(command("query", name)))), None)

    def list(self, prefix: str = "") -> Sequence[Contact]:
        lines = self._ask(command("list", prefix) if prefix else "list")
        return [*filter(None, map(read_registration, lines))]

    def set_property(self, name: str, key: str, values: Sequence[str]) -> None:
        self._ask(command("bot", "set", name, key, *values), _LIBRARY)
        self._keeper.note(name, key, values)

    def get_property(self, name: str, key: str) -> Sequence[str]:
        return [to_string(value) for value in Bottle.parse(self._ask(command("bot", "get", name, key), _LIBRARY)[0])]

    def announce(self, name: str, *, active: bool = True) -> None:
        """Announce a port. If the server is down, a port of this process is announced when it is back."""
        try:
            self._ask(command("announce", name) if active else command("announce", name, "0"))
        except ConnectError:
            if not active or not self._keeper.announced(name, heard=False):
                raise
        else:
            if active:
                self._keeper.announced(name, heard=True)

    def command(self, line: str) -> Sequence[str]:
        if "\n" in line or "\r" in line:
            raise AddressError(f"{line!r} is more than one command")
        return self._ask(line)

    def close(self) -> None:
        self._keeper.close()

    # Used by the registration keeper -----------------------------------------------------------------------------

    def _find(self, name: str) -> Contact | None:
        return self.query(name)

    def _restore(self, record: Record) -> None:
        contact = record.contact
        again = register_command(contact.name, contact.carrier, contact.host, contact.port, record.promise)
        self._ask(again, _LIBRARY)
        self._note(record)
        if record.announced:
            self._ask(command("announce", contact.name))

    # Requests ----------------------------------------------------------------------------------------------------

    @property
    def _place(self) -> str:
        return f"{self.contact.host}:{self.contact.port}"

    def _ask(self, line: str, ending: str = "\n") -> Lines:
        """Send one command. Return all lines of the answer, including the last."""
        return self._ask_all([line], ending)[0]

    def _ask_all(self, commands: Sequence[str], ending: str) -> Sequence[Lines]:
        """Send commands through one connection, each after the answer to the one before. Return the answers."""
        deadline = clock.Deadline.after(self._patience)
        answers = []
        try:
            with contextlib.closing(
                open_stream(self.contact.host, self.contact.port, self._patience, self._key)
            ) as stream:
                for line in commands:
                    stream.send(f"{PREFIX} {line}{ending}".encode("utf-8", "surrogateescape"))
                    answers.append(_answer(stream, deadline, one_line=_is_one_line(line)))
        except (OSError, MiddlewareError) as error:
            self._keeper.mark_unanswered()
            reason = error.strerror if isinstance(error, OSError) and error.strerror else error
            raise NameServerError(
                f"the name server at {self._place} does not answer: {reason};"
                " start one with 'rtf nameserver', in a suite with a fixture yarpserver on which the others depend,"
                " or look for one with 'rtf detect --write'"
            ) from None
        return answers


def _is_one_line(line: str) -> bool:
    return line.partition(" ")[0] in _ONE_LINE or "(format json)" in line


def _answer(stream: Stream, deadline: clock.Deadline, *, one_line: bool) -> Lines:
    lines: Lines = []
    size = 0
    while True:
        raw = stream.run(stream.line())
        lines.append(raw.decode("utf-8", "surrogateescape"))
        if one_line or lines[-1].startswith(("*", "[")):
            return lines
        size += len(raw)
        if size > _MOST or deadline.expired:
            raise ProtocolError(f"its answer has no end after {len(lines)} lines")
