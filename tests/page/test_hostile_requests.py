"""Hostile requests during a run: the server serves others, and the run is not affected.

The run is that of ``conftest.py``, which must pass after these tests.
"""

from __future__ import annotations

import contextlib
import random
import socket
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rtf import clock

if TYPE_CHECKING:
    from live_page import LiveRun

#: Texts that would reveal the server's own code; the run's journal, which any client may read, has none of them.
TELLTALE = (b"Traceback", b'File "', b"site-packages", b"rtf/page", b"starlette", b"uvicorn", b"Error:")


def calm(run: LiveRun, said: bytes = b"") -> bool:
    """Return whether the response leaks nothing, and the server still serves."""
    assert not any(word in said for word in TELLTALE), said
    assert run.page.get("/facts").status == 200
    return True


def head(run: LiveRun, line: str, *headers: str) -> bytes:
    """Return a request with this line."""
    return "\r\n".join([line, f"Host: {run.page.host}:{run.page.port}", *headers, "", ""]).encode("latin-1")


LINES = [
    "",
    "GET",
    "GET /",
    "GET / HTTP/1.1 more",
    "GET / HTTP/9.9",
    "GET / HTTP/0.9",
    "get / http/1.1",
    "G\0T / HTTP/1.1",
    "GET  / HTTP/1.1",
    "GET /\0 HTTP/1.1",
    "GET /\x7f HTTP/1.1",
    "GET /\xff HTTP/1.1",
    "GET http://evil.example/ HTTP/1.1",
    "GET //evil.example/ HTTP/1.1",
    "GET evil HTTP/1.1",
    "GET * HTTP/1.1",
    "CONNECT evil.example:443 HTTP/1.1",
    "OPTIONS * HTTP/1.1",
    "TRACE / HTTP/1.1",
    "PRI * HTTP/2.0",
    "FROBNICATE / HTTP/1.1",
    "GET /%zz HTTP/1.1",
    "GET /files/..%2f..%2f..%2fetc%2fpasswd HTTP/1.1",
    "GET /files/../../../etc/passwd HTTP/1.1",
    "GET /files/%2e%2e/%2e%2e/etc/passwd HTTP/1.1",
    "GET /series/..%00 HTTP/1.1",
    "GET /files/" + "a/" * 4000 + " HTTP/1.1",
    "GET /" + "x" * 70_000 + " HTTP/1.1",
    "GET /events?after=" + "9" * 5000 + " HTTP/1.1",
    "GET /events?" + "after=1&" * 1500 + " HTTP/1.1",
    "\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
    "SSH-2.0-OpenSSH_9.2",
]


@pytest.mark.parametrize("line", LINES, ids=range(len(LINES)))
def test_request_lines(waiting: LiveRun, line: str):
    """Hostile request lines are refused or answered, without internal data."""
    said = waiting.page.say(head(waiting, line), close=True)
    assert b"root:" not in said
    assert calm(waiting, said)


HEADERS = [
    ["Host: evil.example"],
    ["X: " + "y" * 100_000],
    [f"X{number}: y" for number in range(20_000)],
    [" folded"],
    ["X : y"],
    [": y"],
    ["X: a\0b"],
    ["X: a\rb"],
    ["X\nY: z"],
    ["Content-Length: 5", "Content-Length: 6"],
    ["Content-Length: -1"],
    ["Content-Length: 99999999999999999999999"],
    ["Content-Length: x"],
    ["Content-Length: 5", "Transfer-Encoding: chunked"],
    ["Transfer-Encoding: gzip"],
    ["Transfer-Encoding: chunked, chunked"],
    ["Expect: 100-continue"],
    ["Expect: the impossible"],
    ["Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Key: x", "Sec-WebSocket-Version: 13"],
    ["Connection: Upgrade, HTTP2-Settings", "Upgrade: h2c", "HTTP2-Settings: AAMAAABkAAQAoAAAAAIAAAAA"],
    ["Last-Event-ID: \xff"],
    ["Last-Event-ID: 18446744073709551616"],
    ["Range: bytes=0-,1-,2-"],
    ["Authorization: Bearer \xff\xfe"],
    ["Origin: \xff"],
    ["Content-Type: application/json; charset=\xff"],
]


@pytest.mark.parametrize("headers", HEADERS, ids=range(len(HEADERS)))
def test_headers(waiting: LiveRun, headers: list[str]):
    """Hostile headers are refused or ignored."""
    for line in ("GET /events?after=x HTTP/1.1", "POST /control/stop HTTP/1.1", "GET /files/journal.jsonl HTTP/1.0"):
        assert calm(waiting, waiting.page.say(head(waiting, line, *headers), close=True))


@pytest.mark.parametrize(
    "body",
    [
        b"5\r\n{}\r\n",
        b"zz\r\n{}\r\n0\r\n\r\n",
        b"ffffffffffffffff\r\n{}",
        b"-1\r\n{}\r\n",
        b"2;ext=" + b"x" * 50_000 + b"\r\n{}\r\n0\r\n\r\n",
        b"2\r\n{}\r\n0\r\nTrailer: x\r\n\r\nGET /facts HTTP/1.1\r\n\r\n",
        b"",
    ],
)
def test_chunked_nonsense(waiting: LiveRun, body: bytes):
    """Invalid chunked bodies are refused."""
    request = head(
        waiting,
        "POST /control/stop HTTP/1.1",
        "Transfer-Encoding: chunked",
        "Content-Type: application/json",
        f"Authorization: Bearer {waiting.page.token}",
    )
    assert calm(waiting, waiting.page.say(request + body, close=True))


def test_pipelined_requests_are_answered_in_order(waiting: LiveRun):
    """Pipelined requests are answered, also before invalid bytes and during a stream."""
    said = waiting.page.say(head(waiting, "GET /facts HTTP/1.1") * 50 + b"nonsense\r\n\r\n", close=True)
    assert said.count(b"HTTP/1.1 200 OK") == 50
    assert calm(waiting, said)
    said = waiting.page.say(head(waiting, "GET /events?after=99 HTTP/1.1") + b"nonsense\r\n\r\n" * 100, patience=0.3)
    assert calm(waiting, said)
    assert calm(waiting, waiting.page.say(head(waiting, "GET /events?after=99 HTTP/1.1") * 100, patience=0.3))


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.binary(max_size=400))
def test_random_bytes(waiting: LiveRun, data: bytes):
    """Random bytes are survived, also after a valid beginning."""
    assert calm(waiting, waiting.page.say(data, close=True))
    assert calm(waiting, waiting.page.say(b"POST /control/answer HTTP/1.1\r\nHost: " + data, close=True))


def test_flipped_bytes_of_a_right_request(waiting: LiveRun):
    """Damaged requests are survived."""
    luck = random.Random(7)
    right = (
        head(waiting, "POST /control/stop HTTP/1.1", "Content-Type: application/json", "Content-Length: 12")
        + b'{"stage": 2}'
    )
    for _ in range(80):
        data = bytearray(right)
        for _ in range(luck.randrange(1, 4)):
            data[luck.randrange(len(data))] = luck.randrange(256)
        assert calm(waiting, waiting.page.say(bytes(data), close=True))


def test_connections_that_say_nothing_are_cut(waiting: LiveRun):
    """Three hundred silent or slow connections are closed after a time, and others are served."""
    silent = [socket.create_connection((waiting.page.host, waiting.page.port), timeout=30) for _ in range(300)]
    half = head(waiting, "GET /facts HTTP/1.1")[:-2]
    for client in silent[::2]:
        client.sendall(half[: len(half) // 2])
    assert calm(waiting)
    deadline = clock.Deadline.after(30)
    for client in silent:
        client.settimeout(max(0.1, deadline.remaining()))
        with contextlib.suppress(ConnectionResetError):
            assert client.recv(1) == b""
        client.close()
    assert calm(waiting)


def test_a_flood_of_connections_is_bounded(waiting: LiveRun):
    """The number of connections has a limit; after a flood requests are served."""
    clients = []
    for _ in range(1200):
        try:
            clients.append(socket.create_connection((waiting.page.host, waiting.page.port), timeout=5))
        except OSError:
            break
    for client in clients:
        client.close()
    deadline = clock.Deadline.after(20)
    while not serves(waiting):
        assert not deadline.expired
    assert calm(waiting)


def serves(run: LiveRun) -> bool:
    """Return whether a request is answered."""
    try:
        return run.page.get("/facts").status == 200
    except ConnectionError:
        return False


def test_half_open_connections_and_resets(waiting: LiveRun):
    """Connections that are reset at any point are survived."""
    for data in (
        b"",
        b"GET /",
        head(waiting, "GET /events HTTP/1.1"),
        head(waiting, "GET /files/journal.jsonl HTTP/1.1"),
    ):
        for _ in range(20):
            client = socket.create_connection((waiting.page.host, waiting.page.port))
            client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
            client.sendall(data)
            client.close()
    assert calm(waiting)
