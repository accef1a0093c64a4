"""Networks with a key: ports with the same key are connected, others are refused."""

from __future__ import annotations

import socket
from typing import TYPE_CHECKING

import pytest

from rtf.bottle import Bottle
from rtf.middleware.errors import ConnectError
from rtf.middleware.ports import remote
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.rpc import RpcClient, RpcServer

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture
def server(network: Network) -> Iterator[RpcServer]:
    """A server in a network with a key."""
    network.key = b"secret"
    with RpcServer("/server", lambda question: question, network=network) as made:
        yield made


def test_ports_with_the_same_key_talk(server: RpcServer, network: Network):
    """Requests and administration work between ports with the same key."""
    with RpcClient("/client", "/server", network=network) as client:
        assert client.call(Bottle(["hello"]), timeout=5) == Bottle(["hello"])
    assert remote.exists(network, server.contact)


@pytest.mark.parametrize("key", [b"", b"another"])
def test_a_stranger_gets_nowhere(server: RpcServer, network: Network, key: bytes):
    """A port with another key, or none, is not connected."""
    stranger = Network(network.names, key=key, patience=0.5)
    with pytest.raises(ConnectError, match="/server"):
        RpcClient("/stranger", "/server", network=stranger)
    assert [caller.peer for caller in server.inputs] == []


def test_a_peer_without_the_key_gets_no_answer(server: RpcServer):
    """A caller without the key gets only the first message of the handshake."""
    with socket.create_connection((server.contact.host, server.contact.port), timeout=5) as connection:
        connection.sendall(b"CONNECT me\r\n*\r\nq\r\n" + b"x" * 40)
        answer = b""
        while part := connection.recv(1000):
            answer += part
    assert b"/server" not in answer
    assert len(answer) == 40
