"""The client of a name server, with servers that are slow, wrong or gone."""

from __future__ import annotations

import socket
import threading
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

import pytest

from free_ports import free_port
from rtf import clock
from rtf.middleware.carriers.stream import Stream
from rtf.middleware.errors import AddressError, ConnectError, ProtocolError
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.wire import authentication
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


@contextmanager
def serving(serve: Callable[[socket.socket], None], patience: float = 10.0) -> Iterator[RemoteNames]:
    """Yield a client of a server that handles its one caller by this function."""
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def run() -> None:
            connection, _ = listening.accept()
            with connection:
                serve(connection)

        thread = threading.Thread(target=run)
        thread.start()
        names = RemoteNames(Contact("/root", *listening.getsockname()[:2], "tcp"), patience=patience)
        yield names
        names.close()
        thread.join()


def test_no_server():
    """The error about a missing server names its address, and says how to start one."""
    number = free_port()
    names = RemoteNames(Contact("/root", "127.0.0.1", number, "tcp"))
    for ask in (lambda: names.register("/a"), lambda: names.query("/a"), names.list, lambda: names.announce("/a")):
        with pytest.raises(ConnectError, match=rf"127\.0\.0\.1:{number} .*refused; start one with 'rtf nameserver'"):
            ask()
    names.close()


def test_a_server_that_says_nothing():
    """A silent server is an error after the client's patience."""
    gone = threading.Event()
    with serving(lambda _connection: gone.wait(10), 0.2) as names:
        started = clock.monotonic()
        with pytest.raises(ConnectError, match="does not answer"):
            names.query("/a")
        assert 0.1 < clock.monotonic() - started < 5
        gone.set()


@pytest.mark.parametrize(
    "said", [b"", b"registration name /a ip", b"registration name /a ip 127.0.0.1 port 5 type tcp\r\n"]
)
def test_a_server_that_breaks_off(said: bytes):
    """An answer that is cut off raises ConnectError."""

    def serve(connection: socket.socket) -> None:
        connection.recv(100)
        connection.sendall(said)

    with serving(serve) as names, pytest.raises(ConnectError, match="closed the connection"):
        names.query("/a")


def test_a_server_that_never_ends():
    """An endless answer is an error after the client's patience."""

    def serve(connection: socket.socket) -> None:
        with suppress(OSError):  # until the client has had enough
            while True:
                connection.sendall(b"more\r\n" * 1000)

    with serving(serve, 0.2) as names, pytest.raises(ConnectError, match=r"no end|said nothing"):
        names.list()


@pytest.mark.parametrize(
    "said",
    [
        b"registration name /a ip 127.0.0.1 port 70000 type tcp",
        b"registration name /a ip 127.0.0.1 port x type tcp",
        b"registration name /a port 5 type tcp",
        b"registration",
        b"\xff\xfe",
    ],
)
def test_a_server_that_talks_nonsense(said: bytes):
    """An invalid registration in an answer is ignored."""

    def serve(connection: socket.socket) -> None:
        connection.recv(100)
        connection.sendall(said + b"\r\n*** end of message\r\n")

    with serving(serve) as names:
        assert names.query("/a") is None


def test_answers_are_understood_liberally():
    """Answers may have bare line feeds, another order of fields, and further words."""

    def serve(connection: socket.socket) -> None:
        connection.recv(100)
        connection.sendall(b"registration name /a type udp port 5 ip ::1 more words\n*** end\n")

    with serving(serve) as names:
        assert names.query("/a") == Contact("/a", "::1", 5, "udp")


def test_one_command_at_a_time():
    """A line end in an argument is refused, so that it cannot make a second command."""
    names = RemoteNames(Contact("/root", "127.0.0.1", 1, "tcp"))
    for ask in (
        lambda: names.command("list\nNAME_SERVER unregister /a"),
        lambda: names.query("/a\nNAME_SERVER unregister /b"),
        lambda: names.set_property("/a", "k", ["v\r\nNAME_SERVER unregister /b"]),
    ):
        with pytest.raises(AddressError):
            ask()


@pytest.mark.parametrize(("key", "same"), [(b"secret", True), (b"another", False)])
def test_a_server_that_wants_a_key(key: bytes, *, same: bool):
    """The client proves the key before its first command, and reports a server with another key."""

    def serve(connection: socket.socket) -> None:
        with suppress(ProtocolError):
            stream = Stream(connection)
            stream.run(authentication.accept(stream, b"secret"))
            assert stream.run(stream.line()) == b"NAME_SERVER query /a"
            stream.send(b"*** end of message\r\n")

    with serving(serve) as unarmed:
        names = RemoteNames(unarmed.contact, key=key)
        if same:
            assert names.query("/a") is None
        else:
            with pytest.raises(ConnectError, match=r"auth\.conf"):
                names.query("/a")


def test_the_address_that_others_shall_use(server):
    """A client with an address registers ports with it, unless the port gives another one."""
    names = RemoteNames(server.contact, address="127.0.0.9")
    assert names.register("/a").host == "127.0.0.9"
    assert names.register("/b", host="127.0.0.8", port=5).host == "127.0.0.8"
    assert names.register("", carrier="mcast").host.startswith("224.1.")
    names.close()
