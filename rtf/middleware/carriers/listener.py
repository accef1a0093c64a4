"""A thread that accepts connections for all ports of the process: five hundred idle ports cost one thread."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from rtf.middleware.carriers.socket_watcher import SocketWatcher

if TYPE_CHECKING:
    import socket
    from collections.abc import Callable

    Taker = Callable[[socket.socket], None]


class Listener:
    """Accepts connections on any number of listening sockets."""

    def __init__(self) -> None:
        self._watcher = SocketWatcher("rtf-listener")

    def add(self, listening: socket.socket, take: Taker) -> None:
        """Call ``take`` with each accepted connection, in the listener's thread: it must not block."""
        listening.setblocking(False)
        self._watcher.add(listening, partial(_accept, listening, take))

    def remove(self, listening: socket.socket) -> None:
        """Stop accepting on a socket and close it."""
        self._watcher.remove(listening)
        listening.close()


def _accept(listening: socket.socket, take: Taker) -> None:
    try:
        connection, _ = listening.accept()
    except OSError:
        return  # the caller is gone, or no file descriptor is free: it may try again
    connection.setblocking(True)
    take(connection)


#: The listener of this process.
SHARED = Listener()
