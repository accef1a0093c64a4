"""The settings that the ports of a process share: the name server, the dialect, and timeouts."""

from __future__ import annotations

import contextlib
import copy
import socket
import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf.bottle import Dialect
from rtf.middleware.carriers.stream import open_stream
from rtf.middleware.errors import AddressError, ConnectError, MiddlewareError
from rtf.middleware.ports.access import Access

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.carriers.stream import Stream
    from rtf.middleware.ports.names import Names
    from rtf.middleware.wire.contact import Contact

_BACKLOG = 128


@dataclass(frozen=True, slots=True)
class Opening:
    """The actual name and the fixed port number, or 0, under which a port is opened."""

    name: str
    port: int = 0


class Network:
    """A network of ports. ``patience`` is how many seconds a peer may take for a handshake.

    ``report`` is called with a sentence for each problem, such as a lost connection, and ``notice`` for each connection
    that is made or ended, in YARP's words ("Receiving input from /a to /b using tcp"). Both are called from any thread,
    which waits meanwhile, so they must be quick. ``opening`` maps the name of a port that this process opens to its
    actual name and number; the configuration may rename ports or fix their numbers. ``dialect`` is used with all ports;
    None: each reader is asked for its own, see :mod:`rtf.middleware.ports.dialect_probe`. ``key`` is the shared key
    that both ends of every connection must know, see :mod:`rtf.middleware.wire.authentication`; empty: no key.
    ``keyboard`` is the descriptor from which the carrier ``human`` reads, if there is a person to type.
    """

    def __init__(
        self,
        names: Names,
        *,
        dialect: Dialect | None = None,
        patience: float = 5.0,
        report: Callable[[str], None] | None = None,
        notice: Callable[[str], None] | None = None,
        opening: Callable[[str], Opening] = Opening,
        key: bytes = b"",
        keyboard: int | None = None,
    ) -> None:
        self.names = names
        self._dialect = dialect
        self.patience = patience
        self.report = report or _say_nothing
        self.notice = notice or _say_nothing
        self.key = key
        self.keyboard = keyboard
        self._opening = opening
        #: Who may send to the guarded ports of this process, and who may change the connections of all of them.
        self.writers = Access()
        self.admins = Access()

    @property
    def dialect(self) -> Dialect:
        """The dialect of ports that can serve in either, and the first guess at what is received."""
        return self._dialect or Dialect.YARP3

    @dialect.setter
    def dialect(self, dialect: Dialect) -> None:
        self._dialect = dialect

    @property
    def dialect_is_set(self) -> bool:
        """Whether all ports are to be sent to in :attr:`dialect`, instead of being asked which one they speak."""
        return self._dialect is not None

    def in_dialect(self, dialect: Dialect) -> Network:
        """Return a copy for ports that always speak one dialect, such as those of a service that only YARP 4 has."""
        other = copy.copy(self)
        other.dialect = dialect
        return other

    def resolve(self, contact: Contact) -> Contact | None:
        """Return the contact with its address, or None if the name is not registered."""
        if contact.valid:
            return contact
        found = self.names.query(contact.name)
        if found is None or not found.valid:
            return None
        return found.by(contact.carrier or found.carrier)

    def reach(self, target: Contact, patience: float | None = None) -> Stream:
        """Open a connection to an address, authenticated if the network has a key.

        No wait takes longer than ``patience`` seconds; None: that of the network. Raises ConnectError.
        """
        try:
            return open_stream(target.host, target.port, self.patience if patience is None else patience, self.key)
        except (OSError, UnicodeError, MiddlewareError) as error:
            why = getattr(error, "strerror", None) or error
            raise ConnectError(f"Cannot connect to {target.name or target}: {why}") from None

    def open_address(self, name: str, promise: str = "") -> tuple[socket.socket, Contact]:
        """Register a name and listen at the address that the name server assigns. Return the socket and the contact."""
        opening = self._opening(name)
        if opening.name and not opening.name.startswith("/"):
            raise AddressError(f"{opening.name!r} is not a port name: it begins with '/', such as /tester/command:o")
        contact = self.names.register(opening.name, port=opening.port, promise=promise)
        if contact.port:
            try:
                return listen(contact.host, contact.port), contact
            except OSError as error:
                failure = f"{contact.host}:{contact.port}: {error.strerror or error}"
            if opening.port:
                raise self._give_up(contact, f"{failure}; the port number is fixed by the environment")
        # No number was assigned, or another program listens at it: take a free one and register that.
        try:
            listening = listen(contact.host, 0)
        except OSError as error:
            raise self._give_up(contact, f"{contact.host}: {error.strerror or error}") from None
        port = listening.getsockname()[1]
        try:
            again = self.names.register(contact.name, carrier="tcp", host=contact.host, port=port, promise=promise)
        except MiddlewareError:
            listening.close()
            with contextlib.suppress(MiddlewareError):
                self.names.unregister(contact.name)
            raise
        return listening, again

    def _give_up(self, contact: Contact, reason: str) -> ConnectError:
        with contextlib.suppress(MiddlewareError):  # the error that is raised says why it cannot be opened
            self.names.unregister(contact.name)
        return ConnectError(f"{contact.name} cannot listen on {reason}")


def listen(host: str, port: int) -> socket.socket:
    """Return a listening socket. Raises OSError if the address cannot be used."""
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM | socket.SOCK_CLOEXEC)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((host, port))
        listening.listen(_BACKLOG)
    except BaseException:  # a port number out of range is not an OSError
        listening.close()
        raise
    return listening


def _say_nothing(_text: str) -> None:
    """Discard the message."""


_default: list[Network] = []
_lock = threading.Lock()


def set_default_network(network: Network | None) -> None:
    """Set the network of ports that are given none; None: find it by the configuration when needed."""
    with _lock:
        _default[:] = [] if network is None else [network]


def default_network() -> Network:
    """Return the network of this process. The first call finds it by the user's configuration.

    :mod:`rtf.middleware` sets the function that finds it.
    """
    with _lock:
        if not _default:
            _default.append(_find())
        return _default[0]


def find_default_by(find: Callable[[], Network]) -> None:
    """Set the function that finds the network of a process that has set none."""
    global _find  # noqa: PLW0603 - set once, by the package
    _find = find


def _find() -> Network:
    raise AddressError("no function finds the network of this process: import rtf.middleware")
