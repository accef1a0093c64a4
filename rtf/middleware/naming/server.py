"""The name server: a port that stores where the other ports are.

It is a port like any other and accepts requests over any carrier; clients use ``name_ser``. It binds to loopback unless
another address is given. A caller can make it store what :mod:`rtf.middleware.naming.table` allows, and use one thread
and one buffer for each of at most ``MAX_CALLERS`` connections: beyond that the oldest connection is closed.
"""

from __future__ import annotations

import contextlib
import itertools
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING, Self
from weakref import WeakSet

from rtf.bottle import Bottle, Vocab, as_string
from rtf.middleware.errors import AddressError, ConnectError, MiddlewareError
from rtf.middleware.naming.commands import Commands
from rtf.middleware.naming.connector import Connector
from rtf.middleware.naming.discovery import GROUP, PORT, Answerer
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.naming.pools import Numbers, group_slots
from rtf.middleware.naming.store import Database, Memory
from rtf.middleware.naming.subscriptions import Subscriptions
from rtf.middleware.naming.table import Table
from rtf.middleware.naming.work_queue import WorkQueue
from rtf.middleware.ports.access import address_of
from rtf.middleware.ports.network import Network, listen
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.remote import administer
from rtf.middleware.types.codecs import TextCodec
from rtf.middleware.wire.contact import Contact
from rtf.middleware.wire.incoming_message import IncomingMessage
from rtf.middleware.wire.page import Link, Page, Section

if TYPE_CHECKING:
    import os
    import socket
    from collections.abc import Callable, Sequence
    from types import TracebackType

    from rtf.bottle import Dialect
    from rtf.middleware.ports.inputs import Input
    from rtf.middleware.ports.names import Names
    from rtf.middleware.types.codecs import Buffer

MAX_CALLERS = 256
_FALLBACK = "fallback"
_HIGHEST = 65535
#: Seconds that a port may take when it is asked to connect.
_PATIENCE = 2.0
#: Seconds that a port may take to say what it is connected to, for the page, and how many are asked at once.
_PAGE_PATIENCE = 0.5
_ASKED_AT_ONCE = 16


class NameServer:
    """A name server, from construction to ``close``. One process may have any number of them.

    ``port`` 0 chooses a free one. ``portdb`` is a file in which names are stored for the next server. ``discovery`` is
    the port number at which it answers multicast queries on the interface of ``host``; 0: none. ``key`` is the shared
    key, see :mod:`rtf.middleware.wire.authentication`. ``report`` is called with a sentence for each action of its
    own. Raises ConnectError if the address cannot be used, MiddlewareError for the file.
    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = 0,
        *,
        namespace: str = "/root",
        portdb: str | os.PathLike[str] = "",
        discovery: int = 0,
        key: bytes = b"",
        report: Callable[[str], None] | None = None,
    ) -> None:
        if host in ("0.0.0.0", "::", ""):  # noqa: S104 - refused
            raise AddressError(
                f"{host!r} is not an address that other programs can connect to; give an address of this machine"
            )
        if not 0 <= port <= _HIGHEST:
            raise AddressError(f"{port} is not a port number; write one from 1 to {_HIGHEST}, or 0 for a free one")
        with contextlib.ExitStack() as undo:
            listening = _take_address(host, port)
            until_taken = undo.enter_context(contextlib.ExitStack())
            until_taken.callback(listening.close)
            self.contact = Contact(namespace, host, listening.getsockname()[1], "tcp")
            store = Database(portdb) if portdb else Memory()
            undo.callback(store.close)
            number = self.contact.port
            if port:
                table = Table(Numbers.above(number), store)
            else:
                table = Table(Numbers.beside(number), store, group_slots(number))
            _enter_server(table, self.contact, discovery or PORT)
            subscriptions = Subscriptions(table)
            commands = Commands(table, subscriptions, self.contact, self._publish, report)
            #: The same name service, without a connection.
            self.names: Names = LocalNames(table, commands, host)
            network = _OwnNetwork(self.names, listening, self.contact, report, key)
            connector = Connector(network)
            undo.callback(connector.close)
            subscriptions.connect = connector.settle
            self._order = itertools.count()
            self._publishing = WorkQueue("rtf-names-publishing", lambda error: network.report(str(error)))
            undo.callback(self._publishing.close)
            if discovery:
                undo.callback(_start_discovery(self.contact, discovery).close)
            self._port: _ServerPort | None = None
            self._port = own = _ServerPort(commands, network, namespace)
            until_taken.pop_all()  # the port owns the socket now
            undo.callback(own.close)
            self._undo = undo.pop_all()

    def _publish(self, what: str, name: str) -> None:
        """Publish a change at the server's port, in the background."""
        port = self._port
        if port is not None and port.outputs:
            self._publishing.put(next(self._order), partial(_write, port, Bottle([Vocab(what), name])))

    def close(self) -> None:
        """Stop the server. A second call has no effect."""
        self._undo.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class _ServerPort(Port):
    """The port of a name server: its data messages are commands."""

    def __init__(self, commands: Commands, network: Network, name: str) -> None:
        self._commands = commands
        self._leaving: WeakSet[Input] = WeakSet()
        super().__init__(name, network=network)

    def _called(self, connection: socket.socket) -> None:
        """Accept a connection; beyond MAX_CALLERS the oldest one that is not yet closing is closed."""
        with self._lock:
            staying = [caller for caller in self._inputs if caller not in self._leaving]
        if len(staying) >= MAX_CALLERS:
            self._leaving.add(staying[0])
            staying[0].close()
        super()._called(connection)

    def dispatch(self, caller: Input, key: str, text: str, data: Buffer) -> Sequence[Buffer]:
        if key not in ("d", "D"):
            return super().dispatch(caller, key, text, data)
        assert caller.link is not None
        in_lines = caller.link.carrier.text
        delivery = IncomingMessage(
            caller.sender, text, data, self.network.dialect, wants_reply=key == "d", text=in_lines
        )
        address = address_of(caller.socket)
        self._serve(delivery, self.contact.host if address is None else str(address))
        return delivery.answer

    def page(self) -> Page:
        """List all ports with their connections, which the ports are asked for; a slow one is left out."""
        contacts = [one for one in self.network.names.list() if one.name != _FALLBACK]
        with ThreadPoolExecutor(_ASKED_AT_ONCE) as pool:
            outputs = pool.map(self._outputs_of, contacts)
            links = [Link.to(contact, about) for contact, about in zip(contacts, outputs, strict=True)]
        return super().page()._replace(kind="the name server", sections=[Section("Ports", links)])

    def _outputs_of(self, contact: Contact) -> str:
        """Return a remark on the connections of a port."""
        if contact.name == self.name or contact.carrier not in ("tcp", "fast_tcp", ""):
            return contact.carrier
        try:
            peers = administer(self.network, contact, Bottle([Vocab("list"), Vocab("out")]), _PAGE_PATIENCE)
        except MiddlewareError:
            return "does not answer"
        return "" if not len(peers) else "sends to " + ", ".join(map(as_string, peers))

    def deliver(self, delivery: IncomingMessage) -> None:
        """Execute a command from a port of this process."""
        self._serve(delivery, self.contact.host)

    def _serve(self, delivery: IncomingMessage, origin: str) -> None:
        answer = self._commands.answer(delivery.read(), origin)
        if answer.plain:
            delivery.reply(answer.to_text(), _LINES)  # type: ignore[arg-type]  # it is a str
        else:
            delivery.reply(answer.body)


def _write(port: Port, event: Bottle) -> None:
    port.write(event)


class _LinesCodec(TextCodec[str]):
    """Codec of lines, which are the same bytes on every carrier."""

    def encode(self, value: str, dialect: Dialect) -> Sequence[Buffer]:  # noqa: ARG002 - text has no dialect
        return (value.encode("utf-8", "surrogateescape"),)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[str, int]:  # noqa: ARG002
        """Decode all bytes: lines have no length prefix."""
        return bytes(data).decode("utf-8", "surrogateescape"), len(data)

    def to_text(self, value: str) -> str:
        """Return the lines without the last line end, which the port appends."""
        return value.removesuffix("\r\n")


_LINES = _LinesCodec()


class _OwnNetwork(Network):
    """The network of the server's own port, whose address is already open."""

    def __init__(
        self,
        names: Names,
        listening: socket.socket,
        contact: Contact,
        report: Callable[[str], None] | None,
        key: bytes,
    ) -> None:
        super().__init__(names, patience=_PATIENCE, report=report, key=key)
        self._own = listening, contact

    def open_address(self, name: str, promise: str = "") -> tuple[socket.socket, Contact]:  # noqa: ARG002
        return self._own


def _take_address(host: str, port: int) -> socket.socket:
    try:
        return listen(host, port)
    except OSError as error:
        raise ConnectError(
            f"the name server cannot listen on {host}:{port}: {error.strerror or error};"
            " 'rtf where' shows the server in use; for another one give another --ip or --socket"
        ) from None


def _enter_server(table: Table, contact: Contact, discovery: int) -> None:
    """Register the server itself, and remove the entry of an earlier server with another name or address."""
    for known in table.list():
        if "true" in (table.get(known.name, "nameserver") or ()):
            table.unregister(known.name)
    table.register(contact.name, "tcp", contact.host, contact.port)
    table.set(contact.name, "nameserver", ["true"])
    table.register(_FALLBACK, "mcast", GROUP, discovery)


def _start_discovery(contact: Contact, number: int) -> Answerer:
    try:
        return Answerer(contact, number)
    except OSError as error:
        raise ConnectError(
            f"multicast cannot be received at {contact.host}: {error.strerror or error}; start without discovery"
        ) from None
