"""Discovery of a name server by multicast: a datagram with the query to a group, and one with the answer.

A datagram is the CRC-32 of a line, a counter that is always 0 here, and the line. The answer is not authenticated, so
discovery is used only on request, and a server answers only on the interface that it serves.
"""

from __future__ import annotations

import contextlib
import os
import select
import selectors
import socket
import threading
import zlib
from typing import TYPE_CHECKING

from rtf import clock
from rtf.middleware.naming.network_interfaces import own_addresses
from rtf.middleware.wire.datagrams import split
from rtf.middleware.wire.name_server_lines import END, QUERY, read_registration, registration

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rtf.middleware.wire.contact import Contact

GROUP = "224.2.1.1"
PORT = 10000
_HEAD = 8
_MOST = 2048
_AGAIN = 0.5


class Answerer:
    """Answers discovery queries for the server at ``contact``, on the interface of its address, until ``close``.

    Raises OSError if the group cannot be joined there.
    """

    def __init__(self, contact: Contact, port: int = PORT) -> None:
        self._query = f"{QUERY} {contact.name}".encode()
        self._answer = split(f"{registration(contact)}\r\n{END}\r\n".encode())[0]
        self._group = (GROUP, port)
        self._socket = _joined([contact.host], port)
        _speak_on(self._socket, contact.host)
        self._bell = os.eventfd(0, os.EFD_CLOEXEC)
        self._thread = threading.Thread(target=self._run, name="rtf-names-discovery", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop answering."""
        os.eventfd_write(self._bell, 1)
        self._thread.join()
        self._socket.close()
        os.close(self._bell)

    def _run(self) -> None:
        with selectors.DefaultSelector() as selector:
            selector.register(self._socket, selectors.EVENT_READ)
            selector.register(self._bell, selectors.EVENT_READ)
            while all(key.fd != self._bell for key, _ in selector.select()):
                with contextlib.suppress(OSError):  # the network is down for a moment: clients repeat the query
                    if _content(self._socket.recv(_MOST)).rstrip() == self._query:
                        self._socket.sendto(self._answer, self._group)


def detect(
    namespace: str = "/root", *, timeout: float = 3.0, port: int = PORT, addresses: Iterable[str] | None = None
) -> Contact | None:
    """Find the name server of a namespace on all interfaces, or those with ``addresses``; None without an answer."""
    own = [*(own_addresses(inet6=False) if addresses is None else addresses)]
    deadline = clock.Deadline.after(timeout)
    with _joined(own, port) as listening:
        while not deadline.expired:
            _ask(namespace, own, port)
            pause = clock.Deadline.after(_AGAIN).earliest(deadline)
            while select.select([listening], [], [], pause.remaining())[0]:
                found = read_registration(_content(listening.recv(_MOST)).decode("utf-8", "replace").partition("\n")[0])
                if found is not None and found.name == namespace:
                    return found
    return None


def _ask(namespace: str, addresses: list[str], port: int) -> None:
    query = split(f"{QUERY} {namespace}\n".encode())[0]
    for address in addresses:
        with (
            contextlib.suppress(OSError),  # the interface does not support multicast
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking,
        ):
            _speak_on(asking, address)
            asking.sendto(query, (GROUP, port))


def _speak_on(sending: socket.socket, address: str) -> None:
    sending.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(address))
    sending.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)


def _joined(addresses: list[str], port: int) -> socket.socket:
    """Return a socket that has joined the group on interfaces. Raises OSError if none can join."""
    listening = socket.socket(socket.AF_INET, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
    failure: OSError | None = OSError("there is no interface")
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        # Otherwise the socket would receive from interfaces that other programs have joined on, too.
        listening.setsockopt(socket.IPPROTO_IP, _IP_MULTICAST_ALL, 0)
        listening.bind((GROUP, port))
        for address in addresses:
            try:
                membership = socket.inet_aton(GROUP) + socket.inet_aton(address)
                listening.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
                failure = None
            except OSError as error:
                failure = failure and error
        if failure is not None:
            raise failure
    except OSError:
        listening.close()
        raise
    return listening


#: Linux: receive only from joined groups. Python has no name for it.
_IP_MULTICAST_ALL = 49


def _content(datagram: bytes) -> bytes:
    """Return the line of a datagram; empty if its checksum or counter is wrong."""
    payload = datagram[_HEAD:]
    expected = zlib.crc32(payload).to_bytes(4, "little") + b"\0\0\0\0"
    return payload if datagram[:_HEAD] == expected else b""
