"""Byte and segment counters of this machine's TCP connections, from the Linux kernel.

They are read over a netlink socket (``sock_diag(7)``), which needs no privilege and covers the connections of all
programs. Where the kernel does not answer, the result is empty. The layouts are those of ``linux/inet_diag.h`` and
``linux/tcp.h``, which only grow at their ends; Linux 4.19 or later is required.
"""

from __future__ import annotations

import socket
import struct
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator

Address = tuple[str, int]

_NETLINK_SOCK_DIAG = 4
_SOCK_DIAG_BY_FAMILY = 20
_REQUEST_DUMP = 0x301
_ERROR, _DONE = 2, 3
_WITH_INFO = 1 << 1
_ESTABLISHED = 1 << 1
_INET_DIAG_INFO = 2
#: Length, type, flags, number and sender of a netlink message.
_HEAD = struct.Struct("=IHHII")
_REQUEST = struct.Struct("=BBBxI48s")
_ATTRIBUTE = struct.Struct("=HH")
_SOCKET_SIZE = 72
_PORTS = struct.Struct(">HH")
#: Fields of tcp_info and where they are: bytes received, segments with data that were sent, and bytes sent.
_RECEIVED, _SEGMENTS, _SENT = 128, 156, 200
_INFO_SIZE = 208
_LONG, _SHORT = struct.Struct("=Q"), struct.Struct("=I")
_ROOM = 1 << 18
_PATIENCE = 2.0


class Endpoints(NamedTuple):
    """The addresses of the two ends of a connection; ``near`` is the end that the counters belong to."""

    near: Address
    far: Address


class TcpCounters(NamedTuple):
    """Bytes received, bytes sent, and segments with data sent."""

    received: int
    sent: int
    segments_sent: int

    def since(self, before: TcpCounters) -> TcpCounters:
        """Return the difference to an earlier reading."""
        return TcpCounters(*(now - then for now, then in zip(self, before, strict=True)))


def connections() -> dict[Endpoints, TcpCounters]:
    """Return all established IPv4 connections. One within this machine is listed twice, once for each end."""
    request = _REQUEST.pack(socket.AF_INET, socket.IPPROTO_TCP, _WITH_INFO, _ESTABLISHED, b"")
    head = _HEAD.pack(_HEAD.size + len(request), _SOCK_DIAG_BY_FAMILY, _REQUEST_DUMP, 1, 0)
    found = {}
    try:
        with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW | socket.SOCK_CLOEXEC, _NETLINK_SOCK_DIAG) as asking:
            asking.settimeout(_PATIENCE)
            asking.send(head + request)
            for message in _messages(asking):
                ends, counted = _read(message)
                if counted is not None:
                    found[ends] = counted
    except OSError:
        return {}  # the kernel or the container does not allow it
    return found


def _messages(asking: socket.socket) -> Iterator[bytes]:
    while True:
        data = asking.recv(_ROOM)
        start = 0
        while start + _HEAD.size <= len(data):
            size, kind, *_ = _HEAD.unpack_from(data, start)
            if kind in (_DONE, _ERROR) or size < _HEAD.size:
                return
            yield data[start + _HEAD.size : start + size]
            start += (size + 3) & ~3


def _read(message: bytes) -> tuple[Endpoints, TcpCounters | None]:
    near, far = _PORTS.unpack_from(message, 4)
    ends = Endpoints((socket.inet_ntoa(message[8:12]), near), (socket.inet_ntoa(message[24:28]), far))
    start = _SOCKET_SIZE
    while start + _ATTRIBUTE.size <= len(message):
        size, kind = _ATTRIBUTE.unpack_from(message, start)
        if kind == _INET_DIAG_INFO and size >= _ATTRIBUTE.size + _INFO_SIZE:
            info = message[start + _ATTRIBUTE.size :]
            (received,), (sent,) = _LONG.unpack_from(info, _RECEIVED), _LONG.unpack_from(info, _SENT)
            return ends, TcpCounters(received, sent, *_SHORT.unpack_from(info, _SEGMENTS))
        start += max(_ATTRIBUTE.size, (size + 3) & ~3)
    return ends, None
