"""A connected socket that is read in messages and lines, with a bound on everything that a peer may make us keep.

Sockets block, and each is read by one thread: a thread that waits in the kernel is the cheapest way to hear of the next
message. To end the wait somebody else shuts the socket down.
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

    from rtf.middleware.carriers.base import Buffer

#: Larger pieces are memory of their own; see ``take``.
CHUNK = 1 << 16
#: What a connection has as a buffer until something larger comes: there may be thousands of them.
_AT_FIRST = 1 << 13
#: Blocks that together are no larger are sent in one piece.
JOINED = 1 << 12
#: A line of a text carrier or the name server, in bytes.
MAX_LINE = 1 << 20
#: A reply, or a message of a carrier without frames.
MAX_UNFRAMED = 1 << 30
_PAGE = 1 << 12
#: By how many bytes a copy may run ahead of its source and still be slow.
_CLOSE = 32
#: What is kept for copies is as large as the largest of them.
_MOST_COPIED = 4 << 20
_timeval = struct.Struct("@ll")


class StreamClosedError(ProtocolError):
    """The peer is gone."""


class Stream:
    """One TCP or Unix connection. Reading is for one thread at a time, and so is writing; closing is for any.

    What has come and is unread stands in ``memory`` from ``start`` to ``end``; ``view`` is a view of it. Carriers whose
    messages are small and frequent look there themselves, everybody else asks ``peek``, ``take`` and ``window``.
    """

    __slots__ = ("_copy", "_receive_into", "_send", "_spare", "end", "memory", "socket", "start", "view")

    def __init__(self, connected: socket.socket) -> None:
        self.socket = connected
        # Looked up once: finding a method costs as much as a tenth of the system call that it makes.
        self._receive_into = connected.recv_into
        self._send = connected.send
        self.memory = bytearray(_AT_FIRST)
        self.view = memoryview(self.memory)
        self.start = 0
        self.end = 0
        self._spare = bytearray()
        self._copy = bytearray()

    def limit_waiting(self, seconds: float | None) -> None:
        """Let a read or write that takes longer raise WaitTimeoutError; None: wait for ever.

        The kernel keeps the time: Python's own time-out costs a system call more for each read.
        """
        if self.socket.fileno() < 0:
            return  # what was said here goes on elsewhere
        value = _timeval.pack(0, 0) if seconds is None else _timeval.pack(int(seconds), max(1, int(seconds % 1 * 1e6)))
        for option in (socket.SO_RCVTIMEO, socket.SO_SNDTIMEO):
            self.socket.setsockopt(socket.SOL_SOCKET, option, value)

    @property
    def buffered(self) -> int:
        """Bytes that are there already."""
        return self.end - self.start

    def await_size(self, size: int) -> None:
        """Wait until so many bytes are unread in the buffer, which grows as far as it must."""
        while self.end - self.start < size:
            self.more(size)

    def peek(self, size: int) -> memoryview:
        """The next ``size`` bytes (at most a buffer), which stay unread. The view holds until the next call."""
        self.await_size(size)
        return self.view[self.start : self.start + size]

    def window(self) -> memoryview:
        """All bytes that are there already, unread."""
        return self.view[self.start : self.end]

    def more(self, size: int = 1) -> None:
        """Wait for at least one more byte in the window; the buffer grows as far as it must to take ``size``."""
        start, end = self.start, self.end
        if start == end:
            self.start = self.end = start = end = 0
        room = len(self.memory) - start
        if room < size or room == end - start:
            self._make_room(max(size, end - start + 1))
            end = self.end
        try:  # flat, as most messages come by this one call
            count = self._receive_into(self.view[end:] if end else self.memory)
        except OSError as error:
            raise _not_received(error) from None
        if count == 0:
            raise StreamClosedError(_LEFT)
        self.end = end + count

    def fill(self) -> None:
        """Take in what has come, without waiting; the buffer grows as long as more comes than it has room for."""
        start, end = self.start, self.end
        if start == end:
            self.start = self.end = end = 0
        elif end == len(self.memory):
            self._make_room(min(2 * end, CHUNK) if start == 0 and end < CHUNK else end - start + 1)
            end = self.end
        try:
            count = self._receive_into(self.view[end:], 0, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return
        except OSError as error:
            raise _not_received(error) from None
        if count == 0:
            raise StreamClosedError(_LEFT)
        self.end = end + count

    def more_towards(self, size: int) -> None:
        """Wait for more of something that is said to have ``size`` bytes from here on.

        Returns when it is all there, or a good part of it: so the buffer never grows by much more than what has come.
        """
        if size > MAX_UNFRAMED:
            raise ProtocolError(f"{size} bytes are announced; at most {MAX_UNFRAMED} are taken")
        wanted = min(size, max(_BELIEVED, 2 * self.buffered))
        if len(self.memory) - self.start < wanted:
            self._make_room(wanted)
        while self.end - self.start < wanted:  # and no more than that, so that nothing of the next one has to move
            self.end += self._receive(self.view[self.end : self.start + wanted])

    def skip(self, size: int) -> None:
        """Forget bytes that were peeked at."""
        self.start += size

    def take(self, size: int) -> memoryview:
        """The next ``size`` bytes. Few lie in the buffer until the next call, many stay for whoever keeps them."""
        if size <= CHUNK:
            data = self.peek(size)
            self.start += size
            return data
        if size > _BELIEVED:
            return self._take_large(size)
        # The memory of the message before is still in the processor's cache. Whoever keeps that message refers to it.
        if self._spare_references() > _spare_unshared or not size <= len(self._spare) <= 2 * size:
            self._spare = bytearray(size)
        return self._into(memoryview(self._spare)[:size])

    def lend(self, size: int) -> memoryview:
        """The next ``size`` bytes, which are there already. They stay as they are for whoever keeps them."""
        return memoryview(self.memory)[self.start : self.start + size]

    def pass_lent(self, size: int) -> None:
        """Go on behind bytes that were lent. Only if somebody keeps them the buffer is left to them."""
        self.start += size
        if self._references() > _unshared:
            rest = self.view[self.start : self.end]
            self.memory = bytearray(len(self.memory))
            self.view = memoryview(self.memory)
            self.start, self.end = 0, len(rest)
            self.view[: self.end] = rest

    def _into(self, own: memoryview) -> memoryview:
        have = min(self.end - self.start, len(own))
        own[:have] = self.view[self.start : self.start + have]
        self.start += have
        while have < len(own):
            have += self._receive(own[have:])
        return own

    def _take_large(self, size: int) -> memoryview:
        """What a peer only says it will send is not allocated before a good part of it has come."""
        grown = bytearray()
        while len(grown) < size:
            part = min(size - len(grown), max(_BELIEVED, len(grown)))
            grown += self._into(memoryview(bytearray(part)))
        return memoryview(grown)

    def _references(self) -> int:
        return sys.getrefcount(self.memory)

    def _spare_references(self) -> int:
        return sys.getrefcount(self._spare)

    def take_line(self) -> bytes:
        """The next line without its end, be it CR LF or LF."""
        searched = 0
        while True:
            place = self.memory.find(b"\n", self.start + searched, self.end)
            if place >= 0:
                line = bytes(self.view[self.start : place])
                self.start = place + 1
                return line.removesuffix(b"\r")
            searched = self.end - self.start
            if searched > MAX_LINE:
                raise ProtocolError(f"a line of more than {MAX_LINE} bytes")
            self.more()

    def send(self, *blocks: bytes | bytearray | memoryview) -> None:
        """Send all blocks, one after the other; large ones are not joined."""
        size = sum(map(len, blocks))
        if size <= JOINED:  # copying so few bytes is cheaper than a list of places for the kernel
            self.send_bytes(b"".join(blocks))
            return
        pieces = self._out_of_step(blocks)
        try:
            sent = self.socket.sendmsg(pieces)
            while sent < size:
                sent += self.socket.sendmsg(_after(pieces, sent))
        except OSError as error:
            raise _not_sent(error) from None

    def _out_of_step(self, blocks: tuple[Buffer, ...]) -> tuple[Buffer, ...]:
        """The blocks; the first that the kernel would be slow to copy lies where it is not.

        It copies what is sent first to the beginning of a page, and the rest behind it. Where that runs just ahead of
        the source by the lowest twelve bits of the addresses, the processor takes what it reads for what it has just
        written and waits for that ("4K aliasing"), which makes it up to three times as slow; a copy of ours that does
        not costs a tenth of it. Bottles of one blob, as Python allocates them, nearly always lie so.
        """
        before = 0
        for place, block in enumerate(blocks):
            size = len(block)
            if isinstance(block, bytes) and CHUNK < size <= _MOST_COPIED and _is_close(block, before):
                return *blocks[:place], self._copied(block), *blocks[place + 1 :]
            before += size
        return blocks

    def _copied(self, block: bytes) -> memoryview:
        """The same half a page further on, in memory that the next one will use."""
        size = _PAGE + len(block)
        if not size <= len(self._copy) <= 2 * size:
            self._copy = bytearray(size)
        copy = memoryview(self._copy)[_PAGE // 2 :][: len(block)]
        copy[:] = block
        return copy

    def send_bytes(self, data: bytes) -> None:
        """Send one short piece."""
        try:
            sent = self._send(data)
            while sent < len(data):
                sent += self._send(data[sent:])
        except OSError as error:
            raise _not_sent(error) from None

    def send_at_once(self, data: bytes) -> None:
        """Send one short piece without waiting. Raises WaitTimeoutError when the peer has not taken what was before."""
        try:
            sent = self._send(data, socket.MSG_DONTWAIT)
        except OSError as error:
            raise _not_sent(error) from None
        if sent < len(data):
            raise WaitTimeoutError(_FULL)

    def close(self) -> None:
        """Close the connection and wake whoever waits in it."""
        with contextlib.suppress(OSError):
            self.socket.shutdown(socket.SHUT_RDWR)
        self.socket.close()

    def wake(self) -> None:
        """Have whoever waits in it see its end; the descriptor stays until ``close``."""
        with contextlib.suppress(OSError):
            self.socket.shutdown(socket.SHUT_RDWR)

    def _make_room(self, size: int) -> None:
        waiting = bytes(self.view[self.start : self.end])
        if size > len(self.memory):
            self.memory = bytearray(max(2 * len(self.memory), size))
            self.view = memoryview(self.memory)
        self.view[: len(waiting)] = waiting
        self.start, self.end = 0, len(waiting)

    def _receive(self, into: memoryview) -> int:
        try:
            count = self._receive_into(into)
        except OSError as error:
            raise _not_received(error) from None
        if count == 0:
            raise StreamClosedError(_LEFT)
        return count


def _count_references() -> tuple[int, int]:
    """How many references this Python counts to the two buffers of a stream of which nobody keeps anything."""
    with socket.socket() as nowhere:
        stream = Stream(nowhere)
        return stream._references(), stream._spare_references()  # noqa: SLF001 - of this module


_unshared, _spare_unshared = _count_references()
_LEFT = "the peer closed the connection"
_FULL = "the peer does not take what is sent to it"


def _not_received(error: OSError) -> MiddlewareError:
    if isinstance(error, BlockingIOError):
        return WaitTimeoutError("the peer said nothing in time")
    return StreamClosedError(f"the peer is gone: {error.strerror or error}")


def _not_sent(error: OSError) -> MiddlewareError:
    if isinstance(error, BlockingIOError):
        return WaitTimeoutError(_FULL)
    return StreamClosedError(f"the peer is gone: {error.strerror or error}")


#: Bytes that are allocated on a peer's word alone.
_BELIEVED = 8 << 20


def _is_close(block: bytes, before: int) -> bool:
    """Whether a copy of the block, so many bytes behind the beginning of a page, runs just ahead of it."""
    import ctypes  # only for what is large enough to be worth it

    address = ctypes.cast(ctypes.c_char_p(block), ctypes.c_void_p).value or 0
    return 0 < (before - address) % _PAGE <= _CLOSE


def _after(blocks: Sequence[Buffer], sent: int) -> list[memoryview]:
    """The blocks without the bytes that are sent already."""
    rest = []
    for block in blocks:
        if sent < len(block):
            rest.append(memoryview(block)[sent:])
        sent = max(0, sent - len(block))
    return rest
