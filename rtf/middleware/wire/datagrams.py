"""``udp`` and ``mcast``: messages split into datagrams.

A datagram is a checksum (CRC-32) of what follows its first eight bytes, a counter that begins at 0 with each message,
and a piece of the bytes that would travel over TCP. When a piece is missing or damaged, the rest of its message is
discarded.
"""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING

from rtf.middleware.errors import ProtocolError
from rtf.middleware.wire.binary import BinaryReceiver
from rtf.middleware.wire.inbox import Inbox

if TYPE_CHECKING:
    from rtf.middleware.wire.protocol import Message

#: The largest datagram, its first eight bytes included.
MAX_DATAGRAM = 65_499
_head = struct.Struct("<Ii")
#: Counters: of a datagram that may follow any other, and of none that may follow.
_UNCHECKED, _NONE = -1, -2


def split(data: bytes, size: int = MAX_DATAGRAM) -> list[bytes]:
    """Split a message into datagrams."""
    piece = size - _head.size
    datagrams = []
    for number, start in enumerate(range(0, len(data), piece)):
        payload = data[start : start + piece]
        datagrams.append(_head.pack(zlib.crc32(payload), number) + payload)
    return datagrams


class Assembler:
    """Assembles messages from datagrams. ``lost`` counts the messages of which only a part arrived."""

    def __init__(self) -> None:
        self.lost = 0
        self._inbox = Inbox()
        self._messages = BinaryReceiver(self._inbox, acknowledged=False).messages()
        self._next = _NONE  # the expected counter

    def feed(self, datagram: bytes) -> Message | None:
        """Process a datagram. Return the message that it completes, or None. Its data are valid as in the protocol."""
        try:
            return self._add(datagram)
        except ProtocolError:
            self._give_up()
            return None

    def _add(self, datagram: bytes) -> Message | None:
        if len(datagram) < _head.size:
            raise ProtocolError(f"a datagram of {len(datagram)} bytes")
        checksum, number = _head.unpack_from(datagram)
        payload = memoryview(datagram)[_head.size :]
        if number == 0:
            self._give_up()
            self._next = 0
        if self._next == _NONE or number not in (self._next, _UNCHECKED) or zlib.crc32(payload) != checksum:
            raise ProtocolError(f"datagram {number} is damaged, or those before it are missing")
        self._next += 1
        self._inbox.feed(payload)
        step = next(self._messages)
        if isinstance(step, int):
            return None
        self._next = _NONE
        self._inbox.pop(self._inbox.unread)
        return step

    def _give_up(self) -> None:
        """Discard the message that has begun, if one has."""
        if self._next != _NONE:
            self.lost += self._next > 0
            self._next = _NONE
            self._inbox = Inbox()
            self._messages = BinaryReceiver(self._inbox, acknowledged=False).messages()
