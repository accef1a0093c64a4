"""One thread that accepts connections for all ports of the process: five hundred idle ports cost one thread."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from rtf.middleware.watching import Watcher

if TYPE_CHECKING:
    import socket
    from collections.abc import Callable

    Taker = Callable[[socket.socket], None]


class Listener:
    """Waits on any number of listening sockets."""

    def __init__(self) -> None:
        self._watcher = Watcher("rtf-listener")

    def add(self, listening: socket.socket, take: Taker) -> None:
        """Call ``take`` with each connection to a socket; in the listener's thread, so it must be quick."""
        listening.setblocking(False)
        self._watcher.add(listening, partial(_accept, listening, take))

    def remove(self, listening: socket.socket) -> None:
        """Stop waiting on a socket, and close it."""
        self._watcher.remove(listening)
        listening.close()


def _accept(listening: socket.socket, take: Taker) -> None:
    try:
        connection, _ = listening.accept()
    except OSError:
        return  # the caller has gone again, or there are no descriptors left: it may try again
    connection.setblocking(True)
    take(connection)


#: The one of this process.
SHARED = Listener()
