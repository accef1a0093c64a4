"""Datagrams: how a waiting reader is woken, and how many of a burst it keeps."""

from __future__ import annotations

import os
import re
import socket
import threading
from contextlib import contextmanager, suppress
from itertools import islice
from typing import TYPE_CHECKING

import pytest

from rtf.bottle import Bottle, Dialect, as_int
from rtf.middleware.carriers import datagram
from rtf.middleware.carriers.datagram import DatagramInput, Udp
from rtf.middleware.carriers.stream import Stream, StreamClosedError
from rtf.middleware.errors import ConnectError
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.port import Port
from rtf.middleware.types.codecs import BOTTLE
from rtf.middleware.wire import framing
from rtf.middleware.wire.datagrams import split
from rtf.middleware.wire.outgoing_message import OutgoingMessage

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.contact import Contact
    from rtf.middleware.wire.incoming_message import IncomingMessage


#: A burst of as many small messages, of which the kernel's buffer holds some hundred.
BURST = 3000
SMALL_BUFFER = 1 << 16


@contextmanager
def sending_to(reader: Port) -> Iterator[socket.socket]:
    """Connect to a port by udp without a Port, and yield the socket, which sends without waiting."""
    with socket.create_connection((reader.contact.host, reader.contact.port), timeout=10) as connection:
        connection.sendall(Udp.header + framing.sender("/writer"))
        number = framing.read_number(connection.recv(8, socket.MSG_WAITALL))
        own = connection.getsockname()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sending:
        sending.bind(own)
        sending.connect((reader.contact.host, number))
        yield sending


def datagram_of(number: int) -> bytes:
    """Return a message of about 64 bytes in a datagram."""
    message = OutgoingMessage("D", Bottle([number, bytes(28)]), BOTTLE, Dialect.YARP3)
    (datagram,) = split(framing.front("D", "", message.size) + b"".join(message.blocks))
    return datagram


def test_a_burst_is_kept_while_messages_are_processed(network: Network, monkeypatch: pytest.MonkeyPatch):
    """No datagram is lost while callbacks run, although more arrive than the kernel's buffer holds."""
    monkeypatch.setattr(datagram, "_RECEIVE_BUFFER", SMALL_BUFFER)
    received: list[int] = []
    to_send = iter(range(BURST))
    all_here = threading.Event()

    def take(message: IncomingMessage) -> None:
        number = as_int(message.read()[0])
        received.append(number)
        for following in islice(to_send, 3):
            sending.send(datagram_of(following))
        if number == BURST - 1:
            all_here.set()

    with Port("/reader", take, network=network) as reader, sending_to(reader) as sending:
        sending.send(datagram_of(next(to_send)))
        assert all_here.wait(20), f"{len(received)} of {BURST} arrived"
    assert received == list(range(BURST))


def test_losses_are_reported_at_the_end_of_the_connection(network: Network, monkeypatch: pytest.MonkeyPatch):
    """When the connection ends, the reader reports how many datagrams were lost, with a hint."""
    monkeypatch.setattr(datagram, "_RECEIVE_BUFFER", SMALL_BUFFER)
    reports: list[str] = []
    monkeypatch.setattr(network, "report", reports.append)
    waiting, go_on = threading.Event(), threading.Event()

    def take(_: IncomingMessage) -> None:
        waiting.set()
        go_on.wait(20)

    with Port("/reader", take, network=network) as reader, sending_to(reader) as sending:
        sending.send(datagram_of(0))
        assert waiting.wait(20)
        for number in range(1, BURST):
            sending.send(datagram_of(number))
        go_on.set()
    (report,) = reports
    found = re.fullmatch(
        r"Messages from /writer were lost: 0 arrived incomplete, and (\d+) datagrams came when the kernel's buffer of "
        rf"{2 * SMALL_BUFFER} bytes was full; connect by tcp, or raise net.core.rmem_max",
        report,
    )
    assert found is not None, report
    assert 1000 < int(found[1]) < BURST


def receiving() -> DatagramInput:
    """Return the receiving end of a connection on which nothing is sent."""
    connection = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    connection.bind(("127.0.0.1", 0))
    return DatagramInput(Udp(), connection, ("/writer", ""), print)


def test_who_waits_is_woken_when_it_is_closed():
    """Closing the receiving end from another thread wakes a waiting reader."""
    link = receiving()
    ended = threading.Event()

    def wait() -> None:
        with pytest.raises(StreamClosedError, match="/writer stopped"):
            link.receive()
        ended.set()

    thread = threading.Thread(target=wait)
    thread.start()
    link.close()
    assert ended.wait(5)
    thread.join()
    link.release()


def test_closing_a_released_end_wakes_no_other():
    """Closing a released end does not write to its former descriptor, which another object may own."""
    link = receiving()
    link.release()
    others = [os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK) for _ in range(20)]
    link.close()
    for other in others:
        with pytest.raises(BlockingIOError):
            os.eventfd_read(other)
        os.close(other)


@pytest.mark.parametrize("occupied", [1, 100])
def test_a_port_number_in_use_is_not_the_end(network: Network, monkeypatch: pytest.MonkeyPatch, occupied: int):
    """If the handshake's port number is in use for datagrams, the writer tries another, a limited number of times."""
    reach, others = network.reach, []

    def reach_from_an_occupied_number(contact: Contact, patience: float | None = None) -> Stream:
        stream = reach(contact, patience)
        if len(others) < occupied:
            others.append(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            with suppress(OSError):  # another program has it
                others[-1].bind(stream.socket.getsockname())
        return stream

    with BufferedPort("/reader", network=network) as reader, Port("/writer", network=network) as writer:
        with monkeypatch.context() as patched:
            patched.setattr(network, "reach", reach_from_an_occupied_number)
            if occupied > 1:
                with pytest.raises(ConnectError, match="in use"):
                    writer.add_output("/reader", "udp")
            else:
                writer.add_output("/reader", "udp")
        if occupied == 1:
            writer.write(Bottle([1]))
            assert reader.read(5) == Bottle([1])
    for other in others:
        other.close()
