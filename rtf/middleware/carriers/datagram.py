"""``udp`` and ``mcast``: messages split into datagrams. They may be lost, without notice, but never mixed up.

An end that closes notifies the other one over a short text connection. The datagrams themselves are defined in
:mod:`rtf.middleware.wire.datagrams`.
"""

from __future__ import annotations

import contextlib
import os
import socket
import struct
from collections import deque
from typing import TYPE_CHECKING

from rtf.middleware.carriers.base import Carrier, InputLink, OutputLink
from rtf.middleware.carriers.stream import Stream, StreamClosedError
from rtf.middleware.carriers.stream_carrier import announce_end, introduction
from rtf.middleware.errors import ConnectError, MiddlewareError, ProtocolError, WaitTimeoutError
from rtf.middleware.wire import framing
from rtf.middleware.wire.datagrams import MAX_DATAGRAM, Assembler, split
from rtf.middleware.wire.inbox import CHUNK
from rtf.middleware.wire.protocol import read_caller

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.carriers.base import CarrierPort, Group
    from rtf.middleware.wire.contact import Contact
    from rtf.middleware.wire.outgoing_message import OutgoingMessage
    from rtf.middleware.wire.protocol import Caller, Message

#: Seconds that a receiver may take to join a group.
_JOINING = 0.5
#: The requested size of the kernel's receive buffer, in bytes.
_RECEIVE_BUFFER = 4 << 20
#: Options of sockets that the socket module does not name (``asm-generic/socket.h``), and what the second returns
#: (``linux/sock_diag.h``).
_SO_RCVBUFFORCE, _SO_MEMINFO = 33, 55
_memory_facts = struct.Struct("9I")
_BUFFER, _DROPS = 1, 8
#: Room for any datagram.
_ROOM = 1 << 16
#: The most memory of datagrams that wait to be processed, in bytes, and what an empty one takes of it.
_MOST_WAITING = 16 << 20
_OVERHEAD = 64


class DatagramInput(InputLink):
    """The receiving end.

    A sender does not wait for a slow reader, and the kernel keeps few datagrams. So all that have arrived are taken out
    of its buffer before each message: what is left to be lost is what arrives while one message is processed.
    """

    endpoint: socket.socket
    reuses = CHUNK

    def __init__(
        self,
        carrier: Carrier,
        receiving: socket.socket,
        caller: Caller,
        report: Callable[[str], object],
        reply: bytes = b"",
    ) -> None:
        self.carrier = carrier
        self.endpoint = receiving
        self.sender, self.modifiers = caller
        self._report = report
        self._reply = reply
        self._assembler = Assembler()
        self._waiting: deque[bytes] = deque()
        self._size = 0  # memory of the waiting datagrams
        self._closed = False

    def welcome(self, stream: Stream, port: CarrierPort) -> None:  # noqa: ARG002 - the reply has the number of the datagrams
        if self._reply:
            stream.send(self._reply)
        stream.close()

    def receive(self) -> Message:
        while True:
            self._take_all()
            datagram = self._waiting.popleft()
            self._size -= len(datagram) + _OVERHEAD
            message = self._assembler.feed(datagram)
            if message is not None:
                return message

    def _take_all(self) -> None:
        """Take the datagrams that have arrived. Wait for one if none is waiting."""
        take, waiting = self.endpoint.recv, self._waiting
        flags = socket.MSG_DONTWAIT if waiting else 0
        try:
            while self._size < _MOST_WAITING and not self._closed:
                datagram = take(_ROOM, flags)
                waiting.append(datagram)
                self._size += len(datagram) + _OVERHEAD
                flags = socket.MSG_DONTWAIT
        except BlockingIOError:
            pass  # these were all
        except OSError as error:
            raise StreamClosedError(f"cannot receive from {self.sender}: {error.strerror}") from None
        if self._closed:
            raise StreamClosedError(f"{self.sender} stopped sending")

    def close(self) -> None:
        self._closed = True
        with contextlib.suppress(OSError):  # "not connected" is what a group says, but the wait ends
            self.endpoint.shutdown(socket.SHUT_RD)

    def release(self) -> None:
        dropped, room = _kernel_buffer(self.endpoint)
        self.endpoint.close()
        lost = self._assembler.lost
        if dropped or lost:
            self._report(
                f"Messages from {self.sender} were lost: {lost} arrived incomplete, and {dropped} datagrams came when "
                f"the kernel's buffer of {room} bytes was full; connect by tcp, or raise net.core.rmem_max"
            )


def _receiving_socket() -> socket.socket:
    """Return a socket with a large buffer, as far as the kernel permits: unless privileged, ``net.core.rmem_max``."""
    receiving = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        receiving.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, _RECEIVE_BUFFER)
    except PermissionError:
        receiving.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
    return receiving


def _kernel_buffer(receiving: socket.socket) -> tuple[int, int]:
    """Return how many datagrams the kernel had no room for, and the size of its buffer in bytes."""
    facts = _memory_facts.unpack(receiving.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, _memory_facts.size))
    return facts[_DROPS], facts[_BUFFER]


class DatagramOutput(OutputLink):
    """The sending end."""

    endpoint: socket.socket

    def __init__(self, carrier: Carrier, sending: socket.socket, port: CarrierPort, target: Contact) -> None:
        self.carrier = carrier
        self.endpoint = sending
        self._sender = port.name
        self._network = port.network
        self._target = target
        self._size = int(os.environ.get(f"YARP_{carrier.name.upper()}_SIZE") or os.environ.get("YARP_DGRAM_SIZE") or 0)

    def send(self, message: OutgoingMessage) -> None:
        data = b"".join([framing.front(message.key, message.envelope, message.size), *message.blocks])
        try:
            for datagram in split(data, self._size or MAX_DATAGRAM):
                self.endpoint.send(datagram)
        except ConnectionRefusedError:
            return  # the other end is down now;
        except OSError as error:
            raise StreamClosedError(f"cannot send to {self._target.name}: {error.strerror}") from None

    def limit_waiting(self, seconds: float | None) -> None:
        """Do nothing: a sender of datagrams never waits."""

    def close(self, *, politely: bool = True) -> None:
        """End the connection; ``politely`` notifies the other port over a separate connection."""
        self.endpoint.close()
        if politely:
            with contextlib.suppress(OSError, MiddlewareError):  # the other port is gone
                announce_end(self._network, self._target, self._sender)


class Datagrams(Carrier):
    """Base class of udp and mcast."""

    connectionless = True

    def matches(self, header: bytes) -> bool:
        """Compare the lowest four bits of the carrier number."""
        number = framing.specifier(header)
        return number >= 0 and number % 16 == framing.specifier(self.header)


class Udp(Datagrams):
    """One sender, one receiver. The receiver takes datagrams only from the address that made the handshake."""

    name = "udp"
    header = framing.header(0)

    def accept(self, stream: Stream, port: CarrierPort) -> InputLink:
        """Answer with the UDP port number to send to."""
        caller = stream.run(read_caller(stream))
        receiving = _receiving_socket()
        try:
            receiving.bind((stream.socket.getsockname()[0] or port.contact.host, 0))
            receiving.connect(stream.socket.getpeername()[:2])
        except OSError:  # the caller is gone
            receiving.close()
            raise
        reply = framing.yarp_number(receiving.getsockname()[1])
        return DatagramInput(self, receiving, caller, port.network.report, reply)

    def connect(self, stream: Stream, port: CarrierPort, target: Contact) -> OutputLink:
        """Send from the local address of the handshake."""
        stream.send(self.header + framing.sender(introduction(port, target)))
        number = framing.read_number(stream.run(stream.take(8)))
        if not 0 < number < 1 << 16:
            raise ConnectError(f"{target.name} answered with the impossible UDP port {number}")
        own, peer = stream.socket.getsockname(), stream.socket.getpeername()
        sending = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            sending.bind(own[:2])
            sending.connect((peer[0], number))
        except OSError:
            sending.close()
            raise
        stream.close()
        return DatagramOutput(self, sending, port, target)


class McastOutput(DatagramOutput):
    """The sending end for one receiver of a group. Only the first of them sends."""

    def __init__(
        self, carrier: Carrier, sending: socket.socket, port: CarrierPort, target: Contact, group: Group
    ) -> None:
        super().__init__(carrier, sending, port, target)
        self._group = group
        group.members.append(self)

    def send(self, message: OutgoingMessage) -> None:
        members = self._group.members
        if members and members[0] is self:
            super().send(message)

    def close(self, *, politely: bool = True) -> None:
        with contextlib.suppress(ValueError):
            self._group.members.remove(self)
        super().close(politely=politely)


class Mcast(Datagrams):
    """One sender, any number of receivers, each datagram sent once."""

    name = "mcast"
    header = framing.header(1)

    def accept(self, stream: Stream, port: CarrierPort) -> InputLink:
        """Join the multicast group that the caller names."""
        caller = stream.run(read_caller(stream))
        group, number = struct.unpack(">4sH", stream.run(stream.take(6)))
        interface = socket.inet_aton(stream.socket.getsockname()[0] or port.contact.host)
        if not 224 <= group[0] <= 239:  # noqa: PLR2004 - the addresses of groups (RFC 5771)
            raise ProtocolError(f"{caller.name} named {socket.inet_ntoa(group)}, which is not a multicast group")
        receiving = _receiving_socket()
        try:
            receiving.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            receiving.bind((socket.inet_ntoa(group), number))
            receiving.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group + interface)
        except OSError as error:
            receiving.close()
            raise ConnectError(f"cannot join {socket.inet_ntoa(group)}:{number}: {error.strerror}") from None
        return DatagramInput(self, receiving, caller, port.network.report)

    def connect(self, stream: Stream, port: CarrierPort, target: Contact) -> OutputLink:
        """Send the address of the group; the receiver does not answer."""
        interface = stream.socket.getsockname()[0]
        group = port.multicast_group(interface)
        address = socket.inet_aton(group.contact.host)
        stream.send(
            self.header + framing.sender(introduction(port, target)) + address + struct.pack(">H", group.contact.port)
        )
        sending = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            sending.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(interface))
            sending.connect((group.contact.host, group.contact.port))
        except OSError:
            sending.close()
            raise
        # The receiver closes the handshake when it has joined. Earlier datagrams would be lost.
        stream.limit_waiting(_JOINING)
        with contextlib.closing(stream), contextlib.suppress(StreamClosedError, WaitTimeoutError):
            stream.more(1)
        return McastOutput(self, sending, port, target, group)


UDP = Udp()
MCAST = Mcast()
