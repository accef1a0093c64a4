"""Access to the server: hosts, origins, the token, and the headers of every response."""

from __future__ import annotations

import socket
from typing import TYPE_CHECKING

import pytest

from rtf.page.access import Access
from rtf.page.application import MAX_BODY

if TYPE_CHECKING:
    from live_page import Answer, LiveRun


PLACE = ("127.0.0.1", 8080, "secret")


@pytest.mark.parametrize(
    ("host", "port", "header", "ours"),
    [
        ("127.0.0.1", 8080, "127.0.0.1:8080", True),
        ("127.0.0.1", 8080, "LocalHost:8080", True),
        ("127.0.0.1", 8080, "[::1]:8080", True),
        ("127.0.0.1", 8080, "127.0.0.1:8081", False),
        ("127.0.0.1", 8080, "127.0.0.1", False),
        ("127.0.0.1", 8080, "0.0.0.0:8080", False),
        ("127.0.0.1", 8080, "evil.example:8080", False),
        ("127.0.0.1", 8080, "127.0.0.1.evil.example:8080", False),
        ("127.0.0.1", 8080, "127.0.0.1:8080.evil.example", False),
        ("127.0.0.1", 8080, "evil.example@127.0.0.1:8080", False),
        ("127.0.0.1", 8080, f"{socket.gethostname()}:8080", False),
        ("127.0.0.1", 8080, "", False),
        ("127.0.0.1", 80, "127.0.0.1", True),
        ("10.0.0.7", 8080, "10.0.0.7:8080", True),
        ("10.0.0.7", 8080, "10.0.0.8:8080", False),
        ("10.0.0.7", 8080, f"{socket.gethostname().lower()}:8080", True),
        ("robot-pc", 8080, "robot-pc:8080", True),
        ("0.0.0.0", 8080, "192.168.1.5:8080", True),
        ("0.0.0.0", 8080, "192.168.1.5:8081", False),
        ("0.0.0.0", 8080, "evil.example:8080", False),
        ("::", 8080, "[fe80::1]:8080", True),
    ],
)
def test_the_host_header_must_be_ours(host: str, port: int, header: str, *, ours: bool):
    """A host name that does not belong to the server is refused; on all interfaces any address is accepted."""
    access = Access(host, port)
    assert access.knows_host(header) == ours
    assert access.knows_origin(f"http://{header}") == ours


@pytest.mark.parametrize(
    "origin", ["null", "", "https://127.0.0.1:8080", "http://127.0.0.1", "127.0.0.1:8080", "http:/127.0.0.1:8080"]
)
def test_other_origins_are_not_ours(origin: str):
    """A sandboxed page, another scheme and another port are other origins."""
    assert not Access(*PLACE).knows_origin(origin)


@pytest.mark.parametrize(
    ("header", "may"),
    [
        ("Bearer secret", True),
        ("bearer secret", True),
        ("Bearer secreT", False),
        ("Bearer  secret", False),
        ("Bearer", False),
        ("Bearer ", False),
        ("secret", False),
        ("Basic secret", False),
        ("", False),
        ("Bearer s\u00e9cret", False),
    ],
)
def test_only_the_token_controls(header: str, *, may: bool):
    """Only a header with the exact token allows control."""
    assert Access(*PLACE).may_control(header) == may


def test_without_a_token_there_is_no_control():
    """Without a token, as for a finished run, nothing allows control."""
    access = Access("127.0.0.1", 8080)
    assert not access.may_control("Bearer ")


# Over the wire ------------------------------------------------------------------------------------------------------


def safe(answer: Answer) -> bool:
    """Return whether a response has all required headers, and no unsafe one."""
    headers = answer.headers
    policy = headers["content-security-policy"]
    assert "unsafe" not in policy
    assert policy.startswith("default-src 'none'")
    assert "frame-ancestors 'none'" in policy
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["cross-origin-resource-policy"] == "same-origin"
    assert headers["cross-origin-opener-policy"] == "same-origin"
    assert not [name for name in headers if name.startswith("access-control-")]
    return True


@pytest.mark.parametrize(
    "path",
    ["/", "/facts", "/page.css", "/status", "/nothing", "/files/nothing", "/series/nothing", "/compare", "/history"],
)
def test_every_answer_is_guarded(waiting: LiveRun, path: str):
    """Every response has the security headers, errors included."""
    assert safe(waiting.page.get(path))
    assert safe(waiting.page.ask("HEAD", path))
    assert safe(waiting.page.ask("POST", path))


@pytest.mark.parametrize("path", ["/", "/facts", "/events", "/status", "/control/stop"])
@pytest.mark.parametrize(
    "headers",
    [{"Host": "evil.example"}, {"Host": "evil.example:80"}, {"Origin": "http://evil.example"}, {"Origin": "null"}],
)
def test_strangers_get_nothing(waiting: LiveRun, path: str, headers: dict[str, str]):
    """A request of another origin or host name is refused."""
    answer = waiting.page.ask("POST" if "control" in path else "GET", path, **headers)
    assert answer.status == 403
    assert safe(answer)
    assert waiting.page.host.encode() not in answer.body


def control_headers(run: LiveRun) -> dict[str, str]:
    """Return the headers that the page sends."""
    return {"Authorization": f"Bearer {run.page.token}", "Content-Type": "application/json"}


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Authorization": ""}, 401),
        ({"Authorization": "Bearer wrong"}, 401),
        ({"Content-Type": "text/plain"}, 415),
        ({"Content-Type": "application/x-www-form-urlencoded"}, 415),
        ({"Content-Type": ""}, 415),
        ({"Origin": "http://evil.example"}, 403),
        ({"Host": "evil.example:8080"}, 403),
    ],
)
def test_control_is_refused_without_all_it_takes(waiting: LiveRun, headers: dict[str, str], status: int):
    """Control needs token, content type, origin and host."""
    for what in ("stop", "answer"):
        answer = waiting.page.ask(
            "POST", f"/control/{what}", b'{"stage": 2}', **{**control_headers(waiting), **headers}
        )
        assert answer.status == status
        assert safe(answer)


def test_control_is_never_a_get(waiting: LiveRun):
    """Control needs POST, so that no link can stop a robot."""
    for method in ("GET", "HEAD", "PUT", "DELETE", "OPTIONS"):
        assert waiting.page.ask(method, "/control/stop", b'{"stage": 2}', **control_headers(waiting)).status == 405


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (b"", 400),
        (b"{", 400),
        (b"[]", 400),
        (b"\xff\xfe", 400),
        (b"[" * 10_000, 400),
        (b"{}", 400),
        (b'{"stage": 0}', 400),
        (b'{"stage": 3}', 400),
        (b'{"stage": true}', 400),
        (b'{"stage": "1"}', 400),
        (b'{"stage": 1e0}', 400),
        (b'{"stage": 1, "x": "' + b"y" * MAX_BODY + b'"}', 413),
    ],
)
def test_what_is_no_stop_stops_nothing(waiting: LiveRun, body: bytes, status: int):
    """An invalid stop is refused with the reason."""
    answer = waiting.page.ask("POST", "/control/stop", body, **control_headers(waiting))
    assert answer.status == status
    assert answer.json["error"]


@pytest.mark.parametrize(
    ("command", "status"),
    [
        ({}, 400),
        ({"test": "s/waiting", "question": "s/waiting#1"}, 400),
        ({"test": "s/waiting", "question": "s/waiting#1", "answer": True}, 400),
        ({"test": "s/waiting", "question": "s/waiting#1", "answer": "perhaps"}, 400),
        ({"test": "s/waiting", "question": "s/waiting#1", "answer": "\ud800"}, 400),
        ({"test": "s/waiting", "question": "s/waiting#2", "answer": "yes"}, 409),
        ({"test": "\0", "question": "\ud800", "answer": "yes"}, 400),
        ({"test": "s/other", "question": "s/waiting#1", "answer": "yes"}, 409),
    ],
)
def test_what_is_no_answer_answers_nothing(waiting: LiveRun, command: dict[str, object], status: int):
    """An invalid answer is refused with the reason, and the question stays open."""
    answer = waiting.page.control("answer", **command)
    assert answer.status == status
    assert answer.json["error"]
