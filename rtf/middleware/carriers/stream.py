"""A connected socket that is read in messages and lines, with a limit on everything that a peer can make it store.

Sockets are blocking and each is read by one thread: a thread that waits in the kernel is the fastest way to receive the
next message. Another thread ends the wait by shutting the socket down.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import sys
from typing import TYPE_CHECKING

from rtf.middleware.errors import MiddlewareError, ProtocolError, WaitTimeoutError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.types.codecs import Buffer

#: Larger pieces get memory of their own; see ``take``.
CHUNK = 1 << 16
#: The initial size of the buffer, small because there may be thousands of connections.
_AT_FIRST = 1 << 13
#: Blocks with at most this many bytes in total are joined and sent in one call.
JOINED = 1 << 12
#: The longest line of a text carrier or of the name server, in bytes.
MAX_LINE = 1 << 20
#: The largest reply, or message of a carrier without length prefix, in bytes.
MAX_UNFRAMED = 1 << 30
_timeval = struct.Struct("@ll")


class StreamClosedError(ProtocolError):
    """The peer closed the connection, or it was lost."""


class Stream:
    """One TCP or Unix connection. Reading is for one thread at a time, and so is writing; closing is for any.

    Received, unread bytes are in ``memory`` from ``start`` to ``end``; ``view`` is a view of it. Carriers with small,
    frequent messages access these directly; all other code uses ``peek``, ``take`` and ``window``.
    """

    __slots__ = ("_large", "_receive_into", "_send", "end", "memory", "socket", "start", "view")

    def __init__(self, connected: socket.socket) -> None:
        self.socket = connected
        # Looked up once: a method lookup costs a tenth of the system call.
        self._receive_into = connected.recv_into
        self._send = connected.send
        self.memory = bytearray(_AT_FIRST)
        self.view = memoryview(self.memory)
        self.start = 0
        self.end = 0
        self._large = False  # a large piece is in front of the unread bytes, and may still be in use

    def limit_waiting(self, seconds: float | None) -> None:
        """Set the timeout of every read and write, after which it raises WaitTimeoutError; None: no timeout.

        The kernel measures the time: Python's own timeout costs one more system call per read.
        """
        if self.socket.fileno() < 0:
            return  # the socket was handed over to another owner
        value = _timeval.pack(0, 0) if seconds is None else _timeval.pack(int(seconds), max(1, int(seconds % 1 * 1e6)))
        for option in (socket.SO_RCVTIMEO, socket.SO_SNDTIMEO):
            self.socket.setsockopt(socket.SOL_SOCKET, option, value)

    @property
    def buffered(self) -> int:
        """The number of received, unread bytes."""
        return self.end - self.start

    def peek(self, size: int) -> memoryview:
        """Return the next ``size`` bytes (at most a buffer) without consuming them. Valid until the next call."""
        while self.end - self.start < size:
            self.more(size)
        return self.view[self.start : self.start + size]

    def window(self) -> memoryview:
        """Return all received, unread bytes, without consuming them."""
        return self.view[self.start : self.end]

    def more(self, size: int = 1, flags: int = 0) -> None:
        """Wait for at least one more byte. The buffer grows as needed to hold ``size`` bytes.

        With MSG_DONTWAIT it raises WaitTimeoutError if nothing has arrived.
        """
        start, end = self.start, self.end
        if start == end and not self._large:
            self.start = self.end = start = end = 0
        room = len(self.memory) - start
        if room < size or room == end - start or self._large:
            self._make_room(max(size, end - start + 1))
            end = self.end
        try:  # no helper function: most messages arrive through this call
            count = self._receive_into(self.view[end:] if end else self.memory, 0, flags)
        except OSError as error:
            raise _failed(error, _SILENT) from None
        if count == 0:
            raise StreamClosedError(_LEFT)
        self.end = end + count

    def more_towards(self, size: int) -> None:
        """Wait for more of an object that announces ``size`` bytes from here on.

        Returns when all of it, or a good part, has arrived, so the buffer never grows much beyond the received bytes.
        """
        if size > MAX_UNFRAMED:
            raise ProtocolError(f"{size} bytes are announced; at most {MAX_UNFRAMED} are accepted")
        wanted = min(size, max(_BELIEVED, 2 * self.buffered))
        if len(self.memory) - self.start < wanted or self._large:
            self._make_room(wanted)
        while self.end - self.start < wanted:  # not more, so that no bytes of the next object have to be moved
            self.end += self._receive(self.view[self.end : self.start + wanted])

    def skip(self, size: int) -> None:
        """Consume bytes that were returned by ``peek``."""
        self.start += size

    def take(self, size: int) -> memoryview:
        """Return the next ``size`` bytes. Up to CHUNK bytes are valid until the next call, more while it is referenced.

        Memory for a large piece is allocated as bytes arrive, not on the peer's announcement, and is reused for the
        next one if nothing refers to it by then: it is still in the processor's cache.
        """
        if size <= CHUNK:
            data = self.peek(size)
        else:
            while self.end - self.start < size:
                self.more_towards(size)
            data = memoryview(self.memory)[self.start : self.start + size]
            self._large = True
        self.start += size
        return data

    def _references(self) -> int:
        return sys.getrefcount(self.memory)

    def take_line(self, limit: int = MAX_LINE) -> bytes:
        """Return the next line without its end, CR LF or LF. Raises ProtocolError for more than ``limit`` bytes."""
        searched = 0
        while True:
            place = self.memory.find(b"\n", self.start + searched, self.end)
            searched = (place if place >= 0 else self.end) - self.start
            if searched > limit:
                raise ProtocolError(f"a line of more than {limit} bytes")
            if place >= 0:
                line = bytes(self.view[self.start : place])
                self.start = place + 1
                return line.removesuffix(b"\r")
            self.more()

    def send(self, *blocks: bytes | bytearray | memoryview) -> None:
        """Send all blocks in order. Large ones are not joined."""
        size = sum(map(len, blocks))
        if size <= JOINED:  # copying so few bytes is faster than a scatter-gather list
            self.send_bytes(b"".join(blocks))
            return
        try:
            sent = self.socket.sendmsg(blocks)
            while sent < size:
                sent += self.socket.sendmsg(_after(blocks, sent))
        except OSError as error:
            raise _failed(error, _FULL) from None

    def send_bytes(self, data: bytes, flags: int = 0) -> None:
        """Send a short piece. With MSG_DONTWAIT it raises WaitTimeoutError if the peer has not read earlier data."""
        try:
            sent = self._send(data, flags)
            while sent < len(data):
                sent += self._send(data[sent:], flags)
        except OSError as error:
            raise _failed(error, _FULL) from None

    def close(self) -> None:
        """Close the connection and wake the threads that wait in it."""
        self.wake()
        self.socket.close()

    def wake(self) -> None:
        """Shut the connection down so that waiting threads see its end. The descriptor stays open until ``close``."""
        with contextlib.suppress(OSError):
            self.socket.shutdown(socket.SHUT_RDWR)

    def _make_room(self, size: int) -> None:
        """Move the unread bytes to the front, and make room for ``size`` from there.

        The memory is replaced if it is too small, or huge, or a large piece in it is still referenced.
        """
        waiting = bytes(self.view[self.start : self.end])
        room = len(self.memory)
        if size > room:
            room = max(2 * room, size + CHUNK)  # so that the next large message needs no new memory for its front
        elif self._large and room > _MOST_KEPT:
            room = size + CHUNK
        if room != len(self.memory) or (self._large and self._references() > _unshared):
            self.memory = bytearray(room)
            self.view = memoryview(self.memory)
        self.view[: len(waiting)] = waiting
        self.start, self.end = 0, len(waiting)
        self._large = False

    def _receive(self, into: memoryview) -> int:
        try:
            count = self._receive_into(into)
        except OSError as error:
            raise _failed(error, _SILENT) from None
        if count == 0:
            raise StreamClosedError(_LEFT)
        return count


def _count_references() -> int:
    """Return the reference count of the memory of a stream when nothing else refers to it."""
    with socket.socket() as nowhere:
        return Stream(nowhere)._references()  # noqa: SLF001 - of this module


_unshared = _count_references()
_LEFT = "the peer closed the connection"
_SILENT = "the peer did not answer in time"
_FULL = "the peer does not read what is sent to it"


def _failed(error: OSError, late: str) -> MiddlewareError:
    """Return what a failed system call means; ``late`` is said of a timeout."""
    if isinstance(error, BlockingIOError):
        return WaitTimeoutError(late)
    return StreamClosedError(f"the peer is gone: {error.strerror or error}")


#: Bytes that are allocated because a peer announces them, and that are kept between two messages.
_BELIEVED = 8 << 20
_MOST_KEPT = 4 * _BELIEVED


def _after(blocks: Sequence[Buffer], sent: int) -> list[memoryview]:
    """Return the rest of the blocks after the first ``sent`` bytes."""
    rest = []
    for block in blocks:
        if sent < len(block):
            rest.append(memoryview(block)[sent:])
        sent = max(0, sent - len(block))
    return rest
