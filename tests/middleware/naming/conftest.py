"""A name server for each test, and ways to talk to it; nothing may be left of them."""

from __future__ import annotations

import socket
import threading
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from rtf import clock
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.naming.server import NameServer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.middleware.wire.contact import Contact

_LIMIT = 10.0


def wait_until(condition: Callable[[], object], complaint: str, limit: float = _LIMIT) -> None:
    """Wait until a condition holds."""
    deadline = clock.Deadline.after(limit)
    while not condition():
        assert not deadline.expired, f"{complaint}; threads: {[thread.name for thread in threading.enumerate()]}"
        clock.sleep(0.002)


def say(contact: Contact, *pieces: bytes, size: int | None = None) -> bytes:
    """Send bytes to a server, and return its whole answer, or the first ``size`` bytes."""
    with socket.create_connection((contact.host, contact.port), _LIMIT) as connection:
        for piece in pieces:
            connection.sendall(piece)
        if size is None:
            connection.shutdown(socket.SHUT_WR)
        heard = b""
        while size is None or len(heard) < size:
            part = connection.recv(65536)
            if not part:
                break
            heard += part
        return heard


@pytest.fixture(name="wait_until")
def _wait_until() -> Callable[..., None]:
    return wait_until


@pytest.fixture(name="say")
def _say() -> Callable[..., bytes]:
    return say


def _descriptors() -> int:
    return len([*Path("/proc/self/fd").iterdir()])


@pytest.fixture(autouse=True)
def nothing_left() -> Iterator[None]:
    """Check that the test leaves no thread and no descriptor."""
    threads = set(threading.enumerate())
    descriptors = _descriptors()
    yield
    wait_until(lambda: set(threading.enumerate()) <= threads, "a thread is left")
    wait_until(lambda: _descriptors() <= descriptors, "a descriptor is left")


@pytest.fixture
def said() -> list[str]:
    """The reports of the server."""
    return []


@pytest.fixture
def server(nothing_left: None, said: list[str]) -> Iterator[NameServer]:
    """A name server."""
    with NameServer(report=said.append) as running:
        yield running


@pytest.fixture
def names(server: NameServer) -> Iterator[RemoteNames]:
    """A client of the server."""
    client = RemoteNames(server.contact, watch=0.05)
    yield client
    client.close()
