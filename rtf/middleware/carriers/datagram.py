"""``udp`` and ``mcast``: messages split into datagrams. They may be lost, without notice, but never mixed up.

A datagram is a checksum (CRC-32) of what follows its first eight bytes, a counter that begins at 0 with each message,
and a piece of the bytes that would travel over TCP. When a piece is missing or damaged, the rest of its message is
discarded. An end that closes tells the other one over a short text connection.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import struct
import threading
import zlib
from abc import abstractmethod
from typing import TYPE_CHECKING

from rtf.middleware.carriers.base import Carrier, InputLink, Message, OutputLink
from rtf.middleware.carriers.stream import Stream, StreamClosedError
from rtf.middleware.carriers.tcp import read_sender
from rtf.middleware.errors import ConnectError, MiddlewareError, ProtocolError, WaitTimeoutError
from rtf.middleware.wire import framing

if TYPE_CHECKING:
    from rtf.bottle import Dialect
    from rtf.middleware.carriers.base import CarrierPort, Group
    from rtf.middleware.types.codecs import Buffer, Codec
    from rtf.middleware.wire.contact import Contact
    from rtf.middleware.wire.outgoing_message import OutgoingMessage

#: The largest datagram, its first eight bytes included.
MAX_DATAGRAM = 65_499
_head = struct.Struct("<Ii")
_UNCHECKED = -1
#: Seconds that a receiver may take to join a group.
_JOINING = 0.5
#: The requested size of the kernel's receive buffer, in bytes; the kernel may limit it.
_RECEIVE_BUFFER = 4 << 20


def cut(data: bytes, size: int = MAX_DATAGRAM) -> list[bytes]:
    """Split a message into datagrams."""
    piece = size - _head.size
    datagrams = []
    for number, start in enumerate(range(0, len(data), piece)):
        payload = data[start : start + piece]
        datagrams.append(_head.pack(zlib.crc32(payload), number) + payload)
    return datagrams


class Assembler:
    """Assembles messages from datagrams."""

    def __init__(self) -> None:
        self.lost = 0
        self._data = bytearray()
        self._next = 0  # the expected counter; -1: none,
        self._size = 0  # size of the whole message, 0 until
        self._begin = 0  # offset of its port command

    def feed(self, datagram: bytes | memoryview) -> bytes | None:
        """Process a datagram. Return the message that it completes, from its port command on, or None."""
        if len(datagram) < _head.size:
            self._give_up()
            return None
        checksum, number = _head.unpack_from(datagram)
        payload = datagram[_head.size :]
        if zlib.crc32(payload) != checksum:
            self._give_up()
            return None
        if number == 0:
            if self._data:
                self.lost += 1
            self._data.clear()
            self._next, self._size = 0, 0
        if number not in (self._next, _UNCHECKED) or self._next < 0:
            self._give_up()
            return None
        self._next += 1
        self._data += payload
        return self._complete()

    def _complete(self) -> bytes | None:
        if not self._size:
            try:
                self._size = self._measure()
            except ProtocolError:
                self._give_up()
                return None
        if not self._size or len(self._data) < self._size:
            return None
        message = bytes(self._data[self._begin : self._size])
        self._data.clear()
        self._next = -1
        return message

    def _measure(self) -> int:
        """Return the size of the whole message, 0 until its index is complete."""
        if len(self._data) < framing.INDEX_SIZE:
            return 0
        blocks, rest = framing.index_rest(self._data)
        self._begin = framing.INDEX_SIZE + rest
        if len(self._data) < self._begin:
            return 0
        return self._begin + framing.message_size(self._data, framing.INDEX_SIZE, blocks)

    def _give_up(self) -> None:
        if self._next > 0 or self._data:
            self.lost += 1
        self._data.clear()
        self._next = -1


class DatagramInput(InputLink):
    """The receiving end."""

    endpoint: socket.socket
    reuses = 0

    def __init__(
        self, carrier: Carrier, receiving: socket.socket, sender: str, modifiers: str, reply: bytes = b""
    ) -> None:
        self.carrier = carrier
        self._reply = reply
        self.sender = sender
        self.modifiers = modifiers
        self.endpoint = receiving
        self.assembler = Assembler()
        self._buffer = memoryview(bytearray(1 << 16))
        self._bell = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._poll = select.poll()
        self._poll.register(receiving, select.POLLIN)
        self._poll.register(self._bell, select.POLLIN)
        self._closed = False
        self._ending = threading.Lock()  # the descriptor of a closed eventfd is soon reused

    def welcome(self, stream: Stream, port: CarrierPort) -> None:  # noqa: ARG002 - the reply has the number of the datagrams
        if self._reply:
            stream.send(self._reply)
        stream.close()

    def receive(self) -> Message:
        while True:
            self._poll.poll()
            if self._closed:
                raise StreamClosedError(f"{self.sender} stopped sending")
            try:
                size = self.endpoint.recv_into(self._buffer, 0, socket.MSG_DONTWAIT)
            except BlockingIOError:
                continue  # the datagram had a wrong UDP checksum
            except OSError as error:
                raise StreamClosedError(f"cannot receive from {self.sender}: {error.strerror}") from None
            message = self.assembler.feed(self._buffer[:size])
            if message is not None:
                with contextlib.suppress(ProtocolError):  # an invalid message counts as lost
                    command = framing.read_command(message)
                    return command.key, command.text, memoryview(message)[command.data :]

    def answer(self, *reply: Buffer) -> None:
        """Do nothing: datagrams have no replies."""

    def close(self) -> None:
        self._closed = True
        with self._ending:
            if self._bell >= 0:
                os.eventfd_write(self._bell, 1)

    def release(self) -> None:
        self.endpoint.close()
        with self._ending:
            bell, self._bell = self._bell, -1
            os.close(bell)


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
        command = framing.command(message.key, message.envelope)
        data = b"".join([framing.index_of_two(len(command), message.size), command, *message.blocks])
        try:
            for datagram in cut(data, self._size or MAX_DATAGRAM):
                self.endpoint.send(datagram)
        except ConnectionRefusedError:
            return  # the other end is down now;
        except OSError as error:
            raise StreamClosedError(f"cannot send to {self._target.name}: {error.strerror}") from None

    def receive_reply(self, codec: Codec[object], dialect: Dialect) -> object | None:
        """Return None: datagrams have no replies."""

    def finish(self) -> None:
        """Do nothing: datagrams have no acknowledgements."""

    def limit_waiting(self, seconds: float | None) -> None:
        """Do nothing: sending does not wait."""

    def close(self, *, politely: bool = True) -> None:
        """End the connection; ``politely`` tells the other port over a separate connection."""
        self.endpoint.close()
        if politely:
            with contextlib.suppress(OSError, MiddlewareError):  # the other port is gone
                self._tell()

    def _tell(self) -> None:
        stream = self._network.reach(self._target)
        with contextlib.closing(stream):
            stream.send(f"CONNECT admin\r\n~{self._sender}\r\nq\r\n".encode("utf-8", "surrogateescape"))
            while True:  # until it closes: a later connection must not be affected by this command
                stream.take_line()


class Datagrams(Carrier):
    """Base class of udp and mcast."""

    connectionless = True

    def matches(self, header: bytes) -> bool:
        """Compare the lowest four bits of the carrier number."""
        number = framing.specifier(header)
        return number >= 0 and number % 16 == framing.specifier(self.header)

    @abstractmethod
    def accept(self, stream: Stream, port: CarrierPort) -> InputLink:
        """See the base."""


class Udp(Datagrams):
    """One sender, one receiver. The receiver takes datagrams only from the address that made the handshake."""

    name = "udp"
    header = framing.header(0)

    def accept(self, stream: Stream, port: CarrierPort) -> InputLink:
        """Answer with the UDP port number to send to."""
        sender, modifiers = read_sender(stream)
        receiving = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            receiving.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
            receiving.bind((stream.socket.getsockname()[0] or port.contact.host, 0))
            receiving.connect(stream.socket.getpeername()[:2])
        except OSError:  # the caller is gone
            receiving.close()
            raise
        return DatagramInput(self, receiving, sender, modifiers, reply=framing.yarp_number(receiving.getsockname()[1]))

    def connect(self, stream: Stream, port: CarrierPort, target: Contact) -> OutputLink:
        """Send from the local address of the handshake."""
        stream.send(self.header + framing.sender(port.name))
        number = framing.read_number(stream.take(8))
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


def _wait_until_joined(stream: Stream) -> None:
    """Wait until the receiver has joined: it closes the handshake then. Earlier datagrams would be lost."""
    stream.limit_waiting(_JOINING)
    with contextlib.closing(stream), contextlib.suppress(StreamClosedError, WaitTimeoutError):
        stream.more()


class Mcast(Datagrams):
    """One sender, any number of receivers, each datagram sent once."""

    name = "mcast"
    header = framing.header(1)

    def accept(self, stream: Stream, port: CarrierPort) -> InputLink:
        """Join the multicast group that the caller names."""
        sender, modifiers = read_sender(stream)
        group, number = struct.unpack(">4sH", stream.take(6))
        interface = socket.inet_aton(stream.socket.getsockname()[0] or port.contact.host)
        if not 224 <= group[0] <= 239:  # noqa: PLR2004 - the addresses of groups (RFC 5771)
            raise ProtocolError(f"{sender} named {socket.inet_ntoa(group)}, which is not a multicast group")
        receiving = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            receiving.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            receiving.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
            receiving.bind((socket.inet_ntoa(group), number))
            receiving.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group + interface)
        except OSError as error:
            receiving.close()
            raise ConnectError(f"cannot join {socket.inet_ntoa(group)}:{number}: {error.strerror}") from None
        return DatagramInput(self, receiving, sender, modifiers)

    def connect(self, stream: Stream, port: CarrierPort, target: Contact) -> OutputLink:
        """Send the address of the group; the receiver does not answer."""
        interface = stream.socket.getsockname()[0]
        group = port.multicast_group(interface)
        address = socket.inet_aton(group.contact.host)
        stream.send(self.header + framing.sender(port.name) + address + struct.pack(">H", group.contact.port))
        sending = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            sending.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(interface))
            sending.connect((group.contact.host, group.contact.port))
        except OSError:
            sending.close()
            raise
        _wait_until_joined(stream)
        return McastOutput(self, sending, port, target, group)
