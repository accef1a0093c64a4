"""Discovery of a name server by multicast datagrams on loopback."""

from __future__ import annotations

import random
import socket
import zlib
from typing import TYPE_CHECKING

import pytest

from free_ports import free_port
from rtf import clock
from rtf.middleware.naming.discovery import GROUP, Answerer, detect
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

ROOT = Contact("/root", "127.0.0.1", 10321, "tcp")


@pytest.fixture
def number() -> int:
    """A UDP port that is not in use."""
    return free_port(socket.SOCK_DGRAM)


@pytest.fixture
def answering(number: int) -> Iterator[Answerer]:
    """The answerer of a server."""
    answerer = Answerer(ROOT, number)
    yield answerer
    answerer.close()


def datagram(line: bytes, counter: int = 0) -> bytes:
    """Return a line with checksum and counter, as in the specification."""
    return zlib.crc32(line).to_bytes(4, "little") + counter.to_bytes(4, "little") + line


@pytest.fixture
def heard(number: int) -> Iterator[Callable[..., list[bytes]]]:
    """Return a function that sends datagrams to the group, and returns the answers until there is silence."""
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as mouth,
    ):
        ear.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        ear.bind((GROUP, number))
        membership = socket.inet_aton(GROUP) + socket.inet_aton("127.0.0.1")
        ear.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
        mouth.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))

        def say(*said: bytes) -> list[bytes]:
            for data in said:
                mouth.sendto(data, (GROUP, number))
            answers: list[bytes] = []
            while True:  # only after an answer may silence be the end: what the tests send is heard, too
                ear.settimeout(0.2 if any(one[8:].startswith(b"registration") for one in answers) else 10.0)
                try:
                    answers += {ear.recv(2000)} - {*said}
                except TimeoutError:
                    return answers

        yield say


def test_found(answering: Answerer, number: int):
    """``detect`` returns the contact of a server, before its timeout."""
    started = clock.monotonic()
    assert detect(timeout=30, port=number, addresses=["127.0.0.1"]) == ROOT
    assert clock.monotonic() - started < 10


def test_found_on_all_interfaces(answering: Answerer, number: int):
    """Without addresses ``detect`` searches all interfaces, loopback included."""
    assert detect(timeout=30, port=number) == ROOT


def test_not_found(number: int):
    """``detect`` returns None if no server answers within the timeout."""
    assert detect(timeout=0.2, port=number, addresses=["127.0.0.1"]) is None


def test_another_is_not_found(answering: Answerer, number: int):
    """A server does not answer a query for another name."""
    assert detect("/other", timeout=0.3, port=number, addresses=["127.0.0.1"]) is None


def test_to_the_byte(answering: Answerer, heard: Callable[..., list[bytes]]):
    """Query and answer have the bytes of the specification."""
    line = b"registration name /root ip 127.0.0.1 port 10321 type tcp\r\n*** end of message\r\n"
    assert heard(datagram(b"NAME_SERVER query /root\n")) == [datagram(line)]
    assert heard(datagram(b"NAME_SERVER query /root\r\n")) == [datagram(line)]


def test_nothing_else_is_answered(answering: Answerer, heard: Callable[..., list[bytes]], number: int):
    """Datagrams with wrong checksum, counter or command are not answered, and a valid query after them is."""
    question = datagram(b"NAME_SERVER query /root\n")
    chance = random.Random(3)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as mouth:
        mouth.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        for size in (0, 1, 7, 8, 9, 100, 60000):
            mouth.sendto(chance.randbytes(size), (GROUP, number))
    wrong = b"\0" + question[1:], datagram(b"NAME_SERVER query /root\n", 1), datagram(b"NAME_SERVER list\n")
    answers = [answer for answer in heard(*wrong, question) if answer[8:].startswith(b"registration")]
    assert len(answers) == 1


def test_no_such_interface(number: int):
    """An answerer at an address of another machine raises OSError."""
    with pytest.raises(OSError):  # noqa: PT011
        Answerer(Contact("/root", "192.0.2.77", 1, "tcp"), number)


def test_does_not_believe_nonsense(number: int):
    """Invalid answers do not end the search."""
    import threading

    stop = threading.Event()

    def chatter() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as mouth:
            mouth.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
            while not stop.wait(0.01):
                for line in b"registration name /root ip x\r\n", b"\xff" * 50, b"":
                    mouth.sendto(datagram(line), (GROUP, number))
                mouth.sendto(b"registration name /root ip 6.6.6.6 port 6 type tcp\r\n", (GROUP, number))

    thread = threading.Thread(target=chatter)
    thread.start()
    try:
        assert detect(timeout=0.3, port=number, addresses=["127.0.0.1"]) is None
    finally:
        stop.set()
        thread.join()
