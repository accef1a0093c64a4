"""Datagrams: how who waits for them is woken."""

from __future__ import annotations

import os
import socket
import threading
from typing import TYPE_CHECKING

import pytest

from rtf.bottle import Bottle
from rtf.middleware.carriers.datagram import DatagramInput, Udp
from rtf.middleware.carriers.stream import Stream, StreamClosedError
from rtf.middleware.errors import ConnectError
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.port import Port

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.contact import Contact


def receiving() -> DatagramInput:
    """A receiving end to which nobody sends."""
    connection = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    connection.bind(("127.0.0.1", 0))
    return DatagramInput(Udp(), connection, "/writer", "")


def test_who_waits_is_woken_when_it_is_closed():
    """By another thread."""
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


def test_closing_one_that_is_gone_wakes_nobody_else():
    """The number of the descriptor that woke it belongs to somebody else by then."""
    link = receiving()
    link.release()
    others = [os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK) for _ in range(20)]
    link.close()
    for other in others:
        with pytest.raises(BlockingIOError):
            os.eventfd_read(other)
        os.close(other)


@pytest.mark.parametrize("occupied", [1, 100])
def test_a_number_that_somebody_else_has_is_not_the_end(
    network: Network, monkeypatch: pytest.MonkeyPatch, occupied: int
):
    """Datagrams leave from the number of the handshake: another handshake has another. It gives up in the end."""
    reach, others = network.reach, []

    def reach_from_an_occupied_number(contact: Contact, patience: float | None = None) -> Stream:
        stream = reach(contact, patience)
        if len(others) < occupied:
            others.append(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
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
