"""A name service within this process: for tests, for programs with only internal connections, and for a name server."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from rtf.bottle import Bottle
from rtf.middleware.naming.commands import Commands
from rtf.middleware.naming.pools import group_slots
from rtf.middleware.naming.subscriptions import Subscriptions
from rtf.middleware.naming.table import Table
from rtf.middleware.ports.names import Names
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from collections.abc import Sequence

_HOST = "127.0.0.1"


class LocalNames(Names):
    """A name service that uses a table directly. Without one it creates its own, on loopback, without port numbers."""

    def __init__(self, table: Table | None = None, commands: Commands | None = None, host: str = _HOST) -> None:
        self._host = host
        self._table = table or Table(groups=group_slots(os.getpid()))
        self._commands = commands or Commands(self._table, Subscriptions(self._table), Contact(host=host))

    def register(self, name: str, *, carrier: str = "", host: str = "", port: int = 0, promise: str = "") -> Contact:
        carrier = carrier or "tcp"
        return self._table.register(name, carrier, host or ("" if carrier == "mcast" else self._host), port, promise)

    def unregister(self, name: str) -> None:
        self._table.unregister(name)

    def query(self, name: str) -> Contact | None:
        return self._table.query(name)

    def list(self, prefix: str = "") -> Sequence[Contact]:
        return self._table.list(prefix)

    def set_property(self, name: str, key: str, values: Sequence[str]) -> None:
        self._table.set(name, key, values)

    def get_property(self, name: str, key: str) -> Sequence[str]:
        return self._table.get(name, key) or ()

    def announce(self, name: str, *, active: bool = True) -> None:
        self._commands.answer(Bottle(["announce", name, int(active)]), self._host)

    def command(self, line: str) -> Sequence[str]:
        return self._commands.answer(Bottle.parse(line), self._host).to_text().splitlines()
