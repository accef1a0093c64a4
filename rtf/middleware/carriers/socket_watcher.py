"""A thread that waits on many sockets whose events are handled quickly: new connections and small messages."""

from __future__ import annotations

import contextlib
import os
import select
import threading
from functools import partial
from typing import TYPE_CHECKING

from rtf.middleware.carriers.uncaught import report_uncaught

if TYPE_CHECKING:
    import socket
    from collections.abc import Callable

    Taker = Callable[[socket.socket], None]


class SocketWatcher:
    """Calls a function for each socket that is readable. Its thread runs while there is at least one socket.

    The functions must not block, and must accept a call when nothing can be read after all.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._changed = threading.Condition()
        self._poll: select.epoll | None = None
        self._bell = -1
        self._numbers: dict[socket.socket, int] = {}
        self._ready: dict[int, Callable[[], None]] = {}
        self._thread: threading.Thread | None = None

    def add(self, watched: socket.socket, ready: Callable[[], None]) -> None:
        """Call ``ready`` in the watcher's thread, from now on, whenever the socket is readable."""
        with self._changed:
            poll = self._poll = self._poll or self._open()
            number = watched.fileno()
            self._numbers[watched] = number
            known = number in self._ready
            self._ready[number] = ready
            if known:  # a watched socket was closed without remove(), and this one has its number
                with contextlib.suppress(FileNotFoundError):
                    poll.unregister(number)
            poll.register(number, select.EPOLLIN)
            if self._thread is None:
                thread = threading.Thread(target=self._run, args=(poll,), name=self._name, daemon=True)
                thread.start()
                self._thread = thread  # now: if it cannot be started, the next call tries again
            self._changed.notify_all()

    def remove(self, watched: socket.socket) -> None:
        """Stop watching a socket, which must still be open. Other threads wait for its last call to end."""
        with self._changed:
            number = self._numbers.pop(watched, -1)
            if number < 0 or number in self._numbers.values():
                return
            del self._ready[number]
            assert self._poll is not None
            with contextlib.suppress(OSError):  # closed without remove(), which unregistered it
                self._poll.unregister(number)
            thread = self._thread
            if self._ready or thread is None:
                return
            os.eventfd_write(self._bell, 1)
            if thread is threading.current_thread():
                return
            self._changed.wait_for(lambda: self._thread is not thread or self._ready)
            ended = self._thread is not thread
        if ended:
            thread.join()

    @property
    def is_here(self) -> bool:
        """Whether the current thread is the watcher's."""
        return self._thread is threading.current_thread()

    def _open(self) -> select.epoll:
        poll = select.epoll()
        self._bell = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        poll.register(self._bell, select.EPOLLIN)
        return poll

    def _run(self, poll: select.epoll) -> None:
        """Run the event loop. No helper functions: its latency is part of every message."""
        wait, find, bell = poll.poll, self._ready.get, self._bell
        while True:
            for number, _ in wait():
                ready = find(number)
                if ready is not None:
                    try:
                        ready()
                    except BaseException as error:  # noqa: BLE001 - reported like that of any thread; the loop continues
                        report_uncaught(error)
                elif number == bell and self._is_done(bell):
                    return

    def _is_done(self, bell: int) -> bool:
        """Return whether no socket is left. If so, the thread's resources are released."""
        with self._changed:
            with contextlib.suppress(BlockingIOError):
                os.eventfd_read(bell)
            if self._ready:
                return False
            assert self._poll is not None
            self._poll.close()
            os.close(bell)
            self._thread = self._poll = None
            self._changed.notify_all()
            return True


class Listener:
    """Accepts connections on any number of listening sockets: five hundred idle ports cost one thread."""

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


#: The listener of this process, for all ports.
SHARED_LISTENER = Listener()
