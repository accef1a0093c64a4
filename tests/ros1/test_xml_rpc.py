"""XML-RPC: Python's own client and server understand ours, and hostile documents are refused."""

from __future__ import annotations

import socket
import threading
import xmlrpc.client
from contextlib import closing, suppress
from typing import TYPE_CHECKING, Any
from xmlrpc.server import SimpleXMLRPCServer

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.ros1 import xml_rpc
from rtf.ros1.errors import MasterError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence


def answer(function: str, parameters: Sequence[Any]) -> list[Any]:
    """What the server of these tests answers."""
    if function != "echo":
        raise LookupError(f"no function {function}")
    return [1, "", list(parameters)]


@pytest.fixture(scope="module")
def server() -> Iterator[xml_rpc.Server]:
    """A server of ours."""
    with closing(xml_rpc.Server("127.0.0.1", answer)) as opened:
        yield opened


def uri(server: xml_rpc.Server) -> str:
    """Where it is."""
    return f"http://127.0.0.1:{server.port}/"


def test_pythons_client_and_server_understand_ours(server: xml_rpc.Server):
    """And so do those of ROS, which are made with them."""
    values: list[Any] = [1, "ä<&", [2.5, True], {"a": [b"b"]}]
    got = xmlrpc.client.ServerProxy(uri(server), use_builtin_types=True).echo(*values)
    assert got == [1, "", values]
    with SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False, use_builtin_types=True) as other:
        other.register_function(lambda *values: [*values], "echo")
        thread = threading.Thread(target=other.handle_request)
        thread.start()
        assert xml_rpc.call(f"http://127.0.0.1:{other.server_address[1]}", "echo", 1, ["ä"]) == [1, ["ä"]]
        thread.join()


def test_errors_say_who_and_what(server: xml_rpc.Server):
    """An unknown function, nobody there, and no address."""
    with pytest.raises(MasterError, match="refused nothing: no function nothing"):
        xml_rpc.call(uri(server), "nothing")
    with pytest.raises(MasterError, match=r"127\.0\.0\.1:9 does not answer echo: .*refused"):
        xml_rpc.call("http://127.0.0.1:9", "echo")
    for wrong in ("", "localhost", "http://localhost", "http://[", "http://localhost:99999999"):
        with pytest.raises(MasterError, match="is no address; write it as in http://localhost:11311"):
            xml_rpc.call(wrong, "echo")
    with pytest.raises(MasterError, match="echo cannot be sent"):
        xml_rpc.call(uri(server), "echo", 1 << 40)


def ask(server: xml_rpc.Server, request: bytes) -> bytes:
    """What the server answers to a request."""
    with socket.create_connection(("127.0.0.1", server.port)) as connection:
        connection.sendall(request)
        return b"".join(iter(lambda: connection.recv(1 << 16), b""))


BOMB = b"""<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "bbbbbbbb"><!ENTITY c "&b;&b;&b;">]>
<methodCall><methodName>echo</methodName><params><param><value>&c;</value></param></params></methodCall>"""


@pytest.mark.parametrize(
    ("body", "complaint"),
    [
        (BOMB, b"a document type is not accepted"),
        (b"<array><data><value>" * 10_000, b"nested more than"),
        (b"<methodCall><methodName>", b"no element found"),
        (b"", b"no element found"),
        (b"\xff\xfe", b"faultString"),
        (b"<params><param><value><int>x</int></value></param></params>", b"invalid literal"),
        (
            b"<params><param><value><struct><member><value>1</value></member></struct></value></param></params>",
            b"fault",
        ),
    ],
)
def test_hostile_documents_are_refused(server: xml_rpc.Server, body: bytes, complaint: bytes):
    """With a fault, and the server goes on."""
    request = b"POST /RPC2 HTTP/1.0\r\nContent-Length: %d\r\n\r\n" % len(body)
    assert complaint in ask(server, request + body)
    assert xml_rpc.call(uri(server), "echo") == [1, "", []]


@pytest.mark.parametrize("size", [b"99999999999999999999", b"-1", b"x", str(xml_rpc.MAX_BODY + 1).encode()])
def test_hostile_lengths_are_refused(server: xml_rpc.Server, size: bytes):
    """Nothing is read."""
    assert b" 41" in ask(server, b"POST /RPC2 HTTP/1.0\r\nContent-Length: " + size + b"\r\n\r\n").splitlines()[0]


@given(st.binary(max_size=200) | st.text("<>/avlueintrypmsd", max_size=80).map(str.encode))
@pytest.mark.fuzz
def test_any_bytes_are_a_call_or_an_error(document: bytes):
    """It raises nothing else."""
    with suppress(*xml_rpc._UNREADABLE):
        xml_rpc._read(document)
