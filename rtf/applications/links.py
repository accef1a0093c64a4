"""The connections of a running application: made when their ports are there, and again when they are lost."""

from __future__ import annotations

import threading
from contextlib import suppress
from typing import TYPE_CHECKING

from rtf.applications import connections
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
        for index, connection in enumerate(self._wanted):
            if index in self._made:
                continue
            reason = ""
            try:
                if connections.are_there(self._network, connection):
                    connections.connect(self._network, connection)
                    self._made.add(index)
                    self._say(Kind.CONNECTED, f"{connection} is connected by {connection.carrier}")
                else:
                    reason = "one of the ports is not open"
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

    def states(self) -> list[tuple[Connection, bool | None]]:
        """Return each connection, and whether it exists; None if its ports cannot be asked."""
        found: list[tuple[Connection, bool | None]] = []
        for connection in self._wanted:
            try:
                found.append((connection, connections.is_connected(self._network, connection)))
            except MiddlewareError:
                found.append((connection, None))
        return found

    def watch(self) -> None:
        """Make lost connections again. One whose ports cannot be asked, or are not there, is left as it is."""
        for index in sorted(self._made):
            if self._ending.is_set():
                return
            connection = self._wanted[index]
            with suppress(MiddlewareError):
                there = connections.are_there(self._network, connection)
                if there and not connections.is_connected(self._network, connection):
                    self._made.discard(index)
                    self._say(Kind.LOST, f"{connection} is lost")
        self.connect(last=False)

    def _say(self, kind: Kind, text: str) -> None:
        self._said(Happening(kind, text))
