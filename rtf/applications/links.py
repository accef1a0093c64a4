"""The connections of a running application: made when their ports are there, and again when they are lost."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from rtf.applications import connections
from rtf.applications.connections import Link
from rtf.applications.happenings import Happening, Kind
from rtf.middleware.errors import MiddlewareError, NameServerError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.applications.happenings import Say
    from rtf.applications.xml.model import Connection
    from rtf.middleware.ports.network import Network


class Links:
    """The connections of an application. ``said`` is called with what happens to them; ``ending`` ends ``watch``."""

    def __init__(
        self, wanted: Sequence[Connection], network: Network, said: Say, ending: threading.Event | None = None
    ) -> None:
        self._wanted = wanted
        self._network = network
        self._said = said
        self._ending = ending or threading.Event()
        self._made: set[int] = set()

    def connect(self, *, last: bool = True) -> bool:
        """Make the connections that are not made. Returns whether all are. The ``last`` try tells of the others."""
        try:
            known = {one.name for one in self._network.names.list()}
        except MiddlewareError as error:
            if last:
                self._say(Kind.FAILED, f"nothing is connected: {error}")
            return False
        for index, connection in enumerate(self._wanted):
            if index in self._made or self._ending.is_set():
                continue
            gone = [end.port for end in (connection.source, connection.target) if end.port not in known]
            reason = f"{' and '.join(gone)} {'is' if len(gone) == 1 else 'are'} not open" if gone else ""
            try:
                if not gone:
                    connections.connect(self._network, connection)
                    self._made.add(index)
                    self._say(Kind.CONNECTED, f"{connection} is connected by {connection.carrier}")
            except MiddlewareError as error:
                reason = str(error)
            if reason and last:
                self._say(Kind.FAILED, f"{connection} is not connected: {reason}")
        return len(self._made) == len(self._wanted)

    def disconnect(self) -> bool:
        """End the connections that exist. Returns whether all could be ended."""
        done = True
        for connection in self._wanted:
            try:
                if connections.disconnect(self._network, connection):
                    self._say(Kind.STOPPED, f"{connection} is disconnected")
            except NameServerError as error:  # which knows nothing of all others either
                self._say(Kind.FAILED, f"connections are not ended: {error}")
                return False
            except MiddlewareError as error:
                done = False
                self._say(Kind.FAILED, f"{connection} is not disconnected: {error}")
        self._made.clear()
        return done

    def states(self) -> list[tuple[Connection, Link]]:
        """Return each connection, and its state."""
        return [*zip(self._wanted, connections.states(self._network, self._wanted), strict=True)]

    def watch(self) -> None:
        """Make lost connections again. One whose ports cannot be asked, or are not there, is left as it is."""
        for index, (connection, state) in enumerate(self.states()):
            if state is Link.APART and index in self._made:
                self._made.discard(index)
                self._say(Kind.LOST, f"{connection} is lost")
        if len(self._made) < len(self._wanted):
            self.connect(last=False)

    def _say(self, kind: Kind, text: str) -> None:
        self._said(Happening(kind, text))
