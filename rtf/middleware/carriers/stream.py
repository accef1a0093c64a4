"""A connected socket from which a protocol reads, and to which it writes.

Sockets are blocking and each is read by one thread: a thread that waits in the kernel is the fastest way to receive the
next message. Another thread ends the wait by shutting the socket down.
"""

from __future__ import annotations

import contextlib
import socket
import struct
from typing import TYPE_CHECKING, NoReturn, TypeVar

from rtf.middleware.errors import MiddlewareError, ProtocolError, WaitTimeoutError
from rtf.middleware.wire import authentication
from rtf.middleware.wire.inbox import AT_FIRST, Inbox
from rtf.middleware.wire.outgoing_message import JOINED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.types.codecs import Buffer
    from rtf.middleware.wire.inbox import Steps

T = TypeVar("T")
_timeval = struct.Struct("@ll")


class StreamClosedError(ProtocolError):
    """The peer closed the connection, or it was lost."""


class Stream(Inbox):
    """One TCP or Unix connection: an inbox that is filled by a socket.

    Reading is for one thread at a time, and so is writing; closing is for any.
    """

    __slots__ = ("_receive_into", "_send", "socket")

    def __init__(self, connected: socket.socket) -> None:
        super().__init__()
        self.socket = connected
        # Looked up once: a method lookup costs a tenth of the system call.
        self._receive_into = connected.recv_into
        self._send = connected.send

    def limit_waiting(self, seconds: float | None) -> None:
        """Set the timeout of every read and write, after which it raises WaitTimeoutError; None: no timeout.

        The kernel measures the time: Python's own timeout costs one more system call per read.
        """
        value = _timeval.pack(0, 0) if seconds is None else _timeval.pack(int(seconds), max(1, int(seconds % 1 * 1e6)))
        with contextlib.suppress(OSError):  # it is closed, or was handed over to another owner
            for option in (socket.SO_RCVTIMEO, socket.SO_SNDTIMEO):
                self.socket.setsockopt(socket.SOL_SOCKET, option, value)

    def run(self, steps: Steps[T]) -> T:
        """Carry out a part of a protocol: receive and send what it asks for. Return its result."""
        try:
            while True:
                step = next(steps)
                if isinstance(step, int):
                    self.more(step)
                else:
                    self.send(step)
        except StopIteration as end:
            return end.value  # type: ignore[no-any-return]

    def more(self, size: int, flags: int = 0) -> None:
        """Wait for at least one more byte, when ``size`` unread ones are asked for.

        With MSG_DONTWAIT it raises WaitTimeoutError if nothing has arrived.
        """
        if self.start == self.end and size <= AT_FIRST and not self._large:  # the usual case, without one more call
            self.start = self.end = 0
            room: bytearray | memoryview = self.memory
        else:
            room = self.room(size)
        try:
            count = self._receive_into(room, 0, flags)
        except OSError as error:
            raise _failed(error, _SILENT) from None
        if count == 0:
            raise StreamClosedError(_LEFT)
        self.end += count

    def discard(self) -> NoReturn:
        """Wait for the end of the connection, which raises StreamClosedError. What arrives until then is discarded."""
        while True:
            self.start = self.end
            self.more(1)

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

    def send_bytes(self, data: Buffer, flags: int = 0) -> None:
        """Send one block. With MSG_DONTWAIT it raises WaitTimeoutError if the peer has not read earlier data."""
        try:
            sent = self._send(data, flags)
            while sent < len(data):
                sent += self._send(memoryview(data)[sent:], flags)
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


def open_stream(host: str, port: int, patience: float, key: bytes) -> Stream:
    """Open a connection to an address and authenticate it if there is a key. Nothing else is sent.

    No single wait takes longer than ``patience`` seconds. Raises OSError, UnicodeError for an invalid host name, and
    MiddlewareError if the peer does not know the key.
    """
    connection = socket.create_connection((host, port), timeout=patience)
    connection.settimeout(None)
    stream = Stream(connection)
    try:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        stream.limit_waiting(patience)
        if key:
            stream.run(authentication.connect(stream, key))
    except BaseException:
        stream.close()
        raise
    return stream


_LEFT = "the peer closed the connection"
_SILENT = "the peer did not answer in time"
_FULL = "the peer does not read what is sent to it"


def _failed(error: OSError, late: str) -> MiddlewareError:
    """Return what a failed system call means; ``late`` is said of a timeout."""
    if isinstance(error, BlockingIOError):
        return WaitTimeoutError(late)
    return StreamClosedError(f"the peer is gone: {error.strerror or error}")


def _after(blocks: Sequence[Buffer], sent: int) -> list[memoryview]:
    """Return the rest of the blocks after the first ``sent`` bytes."""
    rest = []
    for block in blocks:
        if sent < len(block):
            rest.append(memoryview(block)[sent:])
        sent = max(0, sent - len(block))
    return rest
