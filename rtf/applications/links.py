"""The connections of a running application: made when their ports are there, and again when they are lost."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from rtf.applications import connections
from rtf.applications.connections import Link
from rtf.applications.events import Event, Kind
from rtf.middleware.errors import MiddlewareError, NameServerError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from rtf.applications.events import Say
    from rtf.applications.xml.model import Connection
    from rtf.middleware.ports.network import Network


class Links:
    """The connections of an application. ``said`` is called with what happens to them; ``ending`` ends ``watch``.

    Those that are wanted are watched: at first none, and all after ``connect``. Any thread.
    """

    def __init__(
        self, known: Sequence[Connection], network: Network, said: Say, ending: threading.Event | None = None
    ) -> None:
        self._known = known
        self._network = network
        self._said = said
        self._ending = ending or threading.Event()
        self._changing = threading.Lock()  # a connection is made or ended: who ends it waits until it is made
        self._wanted: set[Connection] = set()
        self._made: set[Connection] = set()

    def want(self, some: Iterable[Connection]) -> None:
        """Have connections made by the next ``watch`` that finds their ports."""
        self._wanted |= {*some}

    def connect(self, some: Iterable[Connection] | None = None, *, last: bool = True) -> bool:
        """Make all connections that are not made, or ``some``. Returns whether all are that are wanted now.

        The ``last`` try reports the others.
        """
        self.want(self._known if some is None else some)
        return self._make(last=last)

    def _make(self, *, last: bool) -> bool:
        try:
            known = {one.name for one in self._network.names.list()}
        except MiddlewareError as error:
            if last:
                self._say(Kind.FAILED, f"nothing is connected: {error}")
            return False
        for connection in [one for one in self._known if one in self._wanted - self._made]:
            with self._changing:
                if self._ending.is_set() or connection not in self._wanted:
                    continue
                reason = self._make_one(connection, known)
            if reason and last:
                self._say(Kind.FAILED, f"{connection} is not connected: {reason}")
        return self._made >= self._wanted

    def _make_one(self, connection: Connection, known: set[str]) -> str:
        """Make a connection. Returns why that was not possible."""
        gone = [end.port for end in (connection.source, connection.target) if end.port not in known]
        if gone:
            return f"{' and '.join(gone)} {'is' if len(gone) == 1 else 'are'} not open"
        try:
            connections.connect(self._network, connection)
        except MiddlewareError as error:
            return str(error)
        self._made.add(connection)
        self._say(Kind.CONNECTED, f"{connection} is connected by {connection.carrier}")
        return ""

    def disconnect(self, some: Iterable[Connection] | None = None) -> bool:
        """End the connections that exist, or ``some`` of them. Returns whether all could be ended.

        They are not wanted any more.
        """
        done = True
        ended = self._known if some is None else [*some]
        self._wanted -= {*ended}
        for connection in ended:
            try:
                with self._changing:
                    self._made.discard(connection)
                    is_ended = connections.disconnect(self._network, connection)
                if is_ended:
                    self._say(Kind.STOPPED, f"{connection} is disconnected")
            except NameServerError as error:  # which knows nothing of all others either
                self._say(Kind.FAILED, f"connections are not ended: {error}")
                return False
            except MiddlewareError as error:
                done = False
                self._say(Kind.FAILED, f"{connection} is not disconnected: {error}")
        return done

    def states(self) -> list[tuple[Connection, Link]]:
        """Return each connection, and its state."""
        return [*zip(self._known, connections.states(self._network, self._known), strict=True)]

    def watch(self) -> None:
        """Make lost connections again. One whose ports cannot be asked, or are not there, is left as it is."""
        for connection, state in self.states():
            if state is Link.APART and connection in self._made:
                self._made.discard(connection)
                self._say(Kind.LOST, f"{connection} is lost")
        if self._wanted - self._made:
            self._make(last=False)

    def _say(self, kind: Kind, text: str) -> None:
        self._said(Event(kind, text))
