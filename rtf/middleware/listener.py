"""One thread that accepts connections for all ports of the process: five hundred idle ports cost one thread."""

from __future__ import annotations

import contextlib
import os
import selectors
import socket
import threading
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    Taker = Callable[[socket.socket], None]


class Listener:
    """Waits on any number of listening sockets. Its thread lives as long as there is one."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._takers: dict[socket.socket, Taker] = {}
        self._changed: list[socket.socket] = []
        self._thread: threading.Thread | None = None
        self._bell = -1

    def add(self, listening: socket.socket, take: Taker) -> None:
        """Call ``take`` with each connection to a socket; in the listener's thread, so it must be quick."""
        listening.setblocking(False)
        with self._lock:
            self._takers[listening] = take
            self._changed.append(listening)
            if self._thread is None:
                self._bell = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
                self._thread = threading.Thread(target=self._run, args=(self._bell,), name="rtf-listener", daemon=True)
                self._thread.start()
            os.eventfd_write(self._bell, 1)

    def remove(self, listening: socket.socket) -> None:
        """Stop waiting on a socket, and close it. When this returns, ``take`` is not called for it any more."""
        with self._lock:
            self._takers.pop(listening, None)
            self._changed.append(listening)
            thread, last = self._thread, not self._takers
            if thread is None:
                return
            if last:
                self._thread = None
            os.eventfd_write(self._bell, 1)
        if last and thread is not threading.current_thread():
            thread.join()

    def _run(self, bell: int) -> None:
        with selectors.DefaultSelector() as selector:
            selector.register(bell, selectors.EVENT_READ)
            while self._update(selector, bell):
                for key, _ in selector.select():
                    if isinstance(key.fileobj, socket.socket):
                        self._accept(key.fileobj)
        os.close(bell)

    def _update(self, selector: selectors.BaseSelector, bell: int) -> bool:
        """Take over what was added and removed; False when nothing is left to wait for."""
        with self._lock, contextlib.suppress(BlockingIOError):
            os.eventfd_read(bell)
        with self._lock:
            changed, self._changed = self._changed, []
            for listening in changed:
                if listening not in self._takers:
                    with contextlib.suppress(KeyError, ValueError):  # it was removed before it was taken over
                        selector.unregister(listening)
                    listening.close()
                elif listening.fileno() >= 0:
                    _register(selector, listening)
            return self._thread is threading.current_thread()

    def _accept(self, listening: socket.socket) -> None:
        with self._lock:
            take = self._takers.get(listening)
        if take is None:
            return
        try:
            connection, _ = listening.accept()
        except OSError:
            return  # the caller has gone again, or there are no descriptors left: it may try again
        connection.setblocking(True)
        take(connection)


def _register(selector: selectors.BaseSelector, listening: socket.socket) -> None:
    """Wait on a socket, whatever its descriptor stood for before: somebody may have closed that one behind our back."""
    known = selector.get_map().get(listening.fileno())
    if known is not None and known.fileobj is listening:
        return
    if known is not None:
        selector.unregister(known.fileobj)
    selector.register(listening, selectors.EVENT_READ)


#: The one of this process.
SHARED = Listener()
