"""The name server: a port that knows where the others are.

It is a port like any other and is asked over any carrier; ``name_ser`` is the one that everybody uses. It binds to
loopback unless another address is given. A caller can make it keep what :mod:`rtf.middleware.naming.table` allows,
one thread and one buffer for each of at most ``MAX_CALLERS`` connections, and no more: beyond that the oldest caller
is sent away.
"""

from __future__ import annotations

import contextlib
import itertools
from functools import partial
from typing import TYPE_CHECKING, Self
from weakref import WeakSet

from rtf.bottle import Bottle, Vocab
from rtf.middleware.codecs import TextCodec
from rtf.middleware.delivery import Delivery
from rtf.middleware.errors import AddressError, ConnectError
from rtf.middleware.names import Contact
from rtf.middleware.naming.commands import Commands
from rtf.middleware.naming.connecting import Connector
from rtf.middleware.naming.discovery import GROUP, PORT, Answerer
from rtf.middleware.naming.errands import Errands
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.naming.pools import Numbers, group_slots
from rtf.middleware.naming.store import Database, Memory
from rtf.middleware.naming.subscriptions import Subscriptions
from rtf.middleware.naming.table import Table
from rtf.middleware.network import Network, listen
from rtf.middleware.port import Port

if TYPE_CHECKING:
    import os
    import socket
    from collections.abc import Callable, Sequence
    from types import TracebackType

    from rtf.bottle import Dialect
    from rtf.middleware.carriers.base import Buffer
    from rtf.middleware.inputs import Input
    from rtf.middleware.naming.book import Names

MAX_CALLERS = 256
_FALLBACK = "fallback"
_HIGHEST = 65535
#: Seconds that a port may take when it is asked to connect.
_PATIENCE = 2.0


class NameServer:
    """A name server, from its making until ``close``; any number can live in one process.

    ``port`` 0 takes any that is free. ``portdb`` is a file in which names are kept for the next server. ``discovery``
    is the number at which it answers those who look for it by multicast, on the interface of ``host``; 0: it does
    not. ``key`` is what callers must know, see :mod:`rtf.middleware.naming.authentication`. ``report`` is called with
    a sentence for what it does by itself. Raises ConnectError when the address cannot be had, MiddlewareError for the
    file.
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
            raise AddressError(f"{host!r} is no address that ports could be told; give one of this machine's own")
        if not 0 <= port <= _HIGHEST:
            raise AddressError(f"{port} is no number to listen at; write one from 1 to {_HIGHEST}, or 0 for any")
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
            #: The same names, asked without a connection.
            self.names: Names = LocalNames(table, commands, host)
            network = _OwnNetwork(self.names, listening, self.contact, report, key)
            connector = Connector(network)
            undo.callback(connector.close)
            subscriptions.connect = connector.settle
            self._order = itertools.count()
            self._publishing = Errands("rtf-names-publishing", lambda error: network.report(str(error)))
            undo.callback(self._publishing.close)
            if discovery:
                undo.callback(_start_discovery(self.contact, discovery).close)
            self._port: _ServerPort | None = None
            self._port = own = _ServerPort(commands, network, namespace)
            until_taken.pop_all()  # the port closes it now
            undo.callback(own.close)
            self._undo = undo.pop_all()

    def _publish(self, what: str, name: str) -> None:
        """Tell those who are connected to the server's port, without waiting for them."""
        port = self._port
        if port is not None and port.outputs:
            self._publishing.put(next(self._order), partial(_write, port, Bottle([Vocab(what), name])))

    def close(self) -> None:
        """Answer nobody any more. Doing so again changes nothing."""
        self._undo.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class _ServerPort(Port):
    """The port of a name server: data are commands."""

    def __init__(self, commands: Commands, network: Network, name: str) -> None:
        self._commands = commands
        self._leaving: WeakSet[Input] = WeakSet()
        super().__init__(name, network=network)

    def _called(self, connection: socket.socket) -> None:
        """See Port. Whoever came first has had the most time; callers that are done are not among them."""
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
        delivery = Delivery(caller.sender, text, data, self.network.dialect, wants_reply=key == "d", text=in_lines)
        self._serve(delivery, _address_of(caller) or self.contact.host)
        return delivery.answer

    def deliver(self, delivery: Delivery) -> None:
        """See Port. Only ports of this process come this way."""
        self._serve(delivery, self.contact.host)

    def _serve(self, delivery: Delivery, origin: str) -> None:
        answer = self._commands.answer(delivery.read(), origin)
        if answer.plain:
            delivery.reply(answer.to_text(), _LINES)  # type: ignore[arg-type]  # it is a str
        else:
            delivery.reply(answer.body)


def _write(port: Port, event: Bottle) -> None:
    port.write(event)


class _LinesCodec(TextCodec[str]):
    """Lines, which are the same bytes on every carrier."""

    def encode(self, value: str, dialect: Dialect) -> Sequence[Buffer]:  # noqa: ARG002 - text has no dialect
        return (value.encode("utf-8", "surrogateescape"),)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[str, int]:  # noqa: ARG002
        """See Codec. Nothing says where lines end, so all are taken."""
        return bytes(data).decode("utf-8", "surrogateescape"), len(data)

    def to_text(self, value: str) -> str:
        """See Codec. The port ends the last line."""
        return value.removesuffix("\r\n")


_LINES = _LinesCodec()


class _OwnNetwork(Network):
    """The network as the server's own port sees it: it has its address already."""

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
            " if another one is there, 'rtf where' says so, else give another --ip or --socket"
        ) from None


def _enter_server(table: Table, contact: Contact, discovery: int) -> None:
    """Register the server itself; what a server of another name or place left behind goes."""
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


def _address_of(caller: Input) -> str:
    """Where a caller is; empty when it has gone, or came by a way without addresses."""
    connection = caller.socket
    try:
        address = connection.getpeername() if connection is not None else ""
    except OSError:
        return ""
    return str(address[0]) if isinstance(address, tuple) else ""
