"""The received, unread bytes of a connection, and the steps by which a protocol reads them.

A protocol is written as generators, which read like blocking code but know no socket: each yields how many bytes it
waits for, or bytes to be sent. A socket drives them in a program (:class:`rtf.middleware.carriers.stream.Stream`), and
any source of bytes in a test::

    inbox = Inbox()
    for step in steps:
        if isinstance(step, int):
            inbox.feed(arrived())
        else:
            send(step)
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, TypeAlias, TypeVar

from rtf.middleware.errors import ProtocolError

if TYPE_CHECKING:
    from collections.abc import Generator

T = TypeVar("T")
#: A part of a protocol that reads. An integer asks for so many unread bytes, which are more than there are. It goes on
#: when some have arrived, and may ask again.
Reading: TypeAlias = "Generator[int, None, T]"
#: A part of a protocol that may also send: bytes are to be sent.
Steps: TypeAlias = "Generator[int | bytes, None, T]"

#: Larger pieces get memory of their own; see ``pop``.
CHUNK = 1 << 16
#: The longest line of a text carrier or of the name server, in bytes.
MAX_LINE = 1 << 20
#: The largest reply, or message of a carrier without length prefix, in bytes.
MAX_UNFRAMED = 1 << 30
#: The initial and smallest size of the memory, small because there may be thousands of connections.
AT_FIRST = 1 << 13
#: Bytes that are allocated because a peer announces them, and that are kept between two messages.
_BELIEVED = 8 << 20
_MOST_KEPT = 4 * _BELIEVED


class Inbox:
    """Unread bytes in ``memory`` from ``start`` to ``end``; ``view`` is a view of it.

    The owner of the bytes' source writes into ``room`` and moves ``end``; protocols move ``start``. Those with small,
    frequent messages access these directly; all other code uses ``take``, ``line`` and ``window``.
    """

    __slots__ = ("_large", "end", "memory", "start", "view")

    def __init__(self) -> None:
        self.memory = bytearray(AT_FIRST)
        self.view = memoryview(self.memory)
        self.start = 0
        self.end = 0
        self._large = False  # a large piece is in front of the unread bytes, and may still be in use

    @property
    def unread(self) -> int:
        """The number of unread bytes."""
        return self.end - self.start

    def window(self) -> memoryview:
        """Return all unread bytes, without consuming them. Valid until more arrive."""
        return self.view[self.start : self.end]

    def room(self, size: int) -> memoryview | bytearray:
        """Return the memory for bytes that arrive, when ``size`` unread ones are waited for.

        For a small ``size`` it has room for bytes of the next object, too. For a large one it has not, so that these
        never have to be moved; and it grows as bytes arrive, not on the peer's announcement.
        """
        start, end = self.start, self.end
        if start == end and not self._large:
            self.start = self.end = start = end = 0
        room = len(self.memory) - start
        if size > CHUNK:
            return self._room_for_large(size, room)
        if room < size or room == end - start or self._large:
            self._make_room(max(size, end - start + 1))
            end = self.end
        return self.view[end:] if end else self.memory

    def feed(self, data: bytes | bytearray | memoryview) -> None:
        """Add bytes that have arrived, for sources that cannot write into ``room``."""
        if self.start == self.end and not self._large:
            self.start = self.end = 0
        if self._large or len(self.memory) - self.end < len(data):
            self._make_room(self.unread + len(data))
        self.view[self.end : self.end + len(data)] = data
        self.end += len(data)

    def take(self, size: int) -> Reading[memoryview]:
        """Wait for ``size`` bytes and consume them; see ``pop``."""
        while self.end - self.start < size:
            yield size
        return self.pop(size)

    def pop(self, size: int) -> memoryview:
        """Consume ``size`` bytes, which have arrived. Valid until more arrive, or if large while it is referenced.

        The memory of a large piece is reused for the next one if nothing refers to it by then: it is still in the
        processor's cache.
        """
        if size > CHUNK:
            data = memoryview(self.memory)[self.start : self.start + size]
            self._large = True
        else:
            data = self.view[self.start : self.start + size]
        self.start += size
        return data

    def line(self, limit: int = MAX_LINE) -> Reading[bytes]:
        """Consume the next line and return it without its end, CR LF or LF.

        Raises ProtocolError for more than ``limit`` bytes.
        """
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
            yield 2 * searched + 1  # its length is not known; a long one is read in large pieces

    def _room_for_large(self, size: int, room: int) -> memoryview:
        if size > MAX_UNFRAMED:
            raise ProtocolError(f"{size} bytes are announced; at most {MAX_UNFRAMED} are accepted")
        if self._large or room < min(size, _BELIEVED) or room == self.end - self.start:
            self._make_room(min(size, max(_BELIEVED, 2 * (self.end - self.start))))
        return self.view[self.end : self.start + size]

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

    def _references(self) -> int:
        return sys.getrefcount(self.memory)


#: The reference count of the memory of an inbox when nothing else refers to it.
_unshared = Inbox()._references()  # noqa: SLF001 - of this module
