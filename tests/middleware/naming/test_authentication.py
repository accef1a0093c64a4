"""Authentication: both ends of a connection prove that they know the key."""

from __future__ import annotations

import hmac
import socket
import threading
from typing import TYPE_CHECKING

import pytest

from rtf.middleware.carriers.stream import Stream
from rtf.middleware.errors import MiddlewareError, ProtocolError
from rtf.middleware.naming.configuration import find_key
from rtf.middleware.wire import authentication
from rtf.resources import ResourceError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

KEY = b"a secret"
Ends = tuple[Stream, Stream]


@pytest.fixture
def ends() -> Iterator[Ends]:
    """The two ends of a connection."""
    one, other = (Stream(end) for end in socket.socketpair())
    for end in one, other:
        end.limit_waiting(2.0)
    yield one, other
    one.close()
    other.close()


def outcome(work: Callable[[], None]) -> tuple[threading.Thread, list[MiddlewareError]]:
    """Start a function in a thread; return the thread, and a list for the error."""
    errors: list[MiddlewareError] = []

    def run() -> None:
        try:
            work()
        except MiddlewareError as error:
            errors.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    return thread, errors


def test_the_same_key(ends: Ends):
    """Two ends with the same key accept each other, and no byte after the handshake is consumed."""
    thread, errors = outcome(lambda: ends[0].run(authentication.accept(ends[0], KEY)))
    ends[1].run(authentication.connect(ends[1], KEY))
    ends[1].send(b"YA\xe4\x1e\x00\x00RP")
    thread.join()
    assert errors == []
    assert bytes(ends[0].run(ends[0].take(8))) == b"YA\xe4\x1e\x00\x00RP"


def test_to_the_byte(ends: Ends):
    """Each of the three messages is a random number, and a signature of all numbers up to it."""
    thread, errors = outcome(lambda: ends[0].run(authentication.accept(ends[0], KEY)))
    first = bytes(ends[1].run(ends[1].take(40)))
    assert first[8:] == hmac.digest(KEY, first[:8], "sha256")
    second = b"12345678"
    ends[1].send(second + hmac.digest(KEY, first[:8] + second, "sha256"))
    third = bytes(ends[1].run(ends[1].take(40)))
    assert third[8:] == hmac.digest(KEY, first[:8] + second + third[:8], "sha256")
    thread.join()
    assert errors == []


@pytest.mark.parametrize(("ours", "theirs"), [(KEY, b"another"), (b"another", KEY), (KEY, KEY + b" ")])
def test_another_key(ends: Ends, ours: bytes, theirs: bytes):
    """Two ends with different keys refuse each other; the caller refuses first, and has sent no signature."""
    thread, errors = outcome(lambda: ends[0].run(authentication.accept(ends[0], ours)))
    with pytest.raises(ProtocolError, match=r"does not know the key .*auth\.conf"):
        ends[1].run(authentication.connect(ends[1], theirs))
    ends[1].close()
    thread.join()
    assert len(errors) == 1


def test_a_caller_without_a_key(ends: Ends):
    """A caller that sends other bytes than the proof is refused."""
    thread, errors = outcome(lambda: ends[0].run(authentication.accept(ends[0], KEY)))
    ends[1].send(b"CONNECT me\r\n" + b"d\r\nhello\r\n" * 4)
    thread.join()
    assert "does not know the key" in str(errors[0])


def test_what_was_recorded_is_of_no_use(ends: Ends):
    """A recorded proof is refused in another handshake."""
    thread, _ = outcome(lambda: ends[0].run(authentication.accept(ends[0], KEY)))
    first = bytes(ends[1].run(ends[1].take(40)))
    answer = b"12345678" + hmac.digest(KEY, first[:8] + b"12345678", "sha256")
    ends[1].send(answer)
    thread.join()
    bytes(ends[1].run(ends[1].take(40)))
    thread, errors = outcome(lambda: ends[0].run(authentication.accept(ends[0], KEY)))
    assert bytes(ends[1].run(ends[1].take(40))) != first
    ends[1].send(answer)
    thread.join()
    assert "does not know the key" in str(errors[0])


def test_one_that_says_nothing(ends: Ends):
    """A peer that sends nothing is an error after the timeout of the stream."""
    ends[1].limit_waiting(0.05)
    with pytest.raises(MiddlewareError):
        ends[1].run(authentication.connect(ends[1], KEY))


def test_where_the_key_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The key is found in the section AUTH of auth.conf; without it authentication is off."""
    monkeypatch.chdir(tmp_path)
    environment = {"YARP_CONFIG_HOME": str(tmp_path / "config"), "YARP_DATA_HOME": str(tmp_path / "data")}
    (tmp_path / "config").mkdir()
    assert find_key(environment) == b""
    path = tmp_path / "config" / "auth.conf"
    for text, key in (
        ("[AUTH]\nkey secret\n", b"secret"),
        ("[AUTH]\nkey 12345\n", b"12345"),
        ('[AUTH]\nkey "a b"\n', b"a b"),
        ("[AUTH]\n", b""),
        ("key secret\n", b""),
        ("[OTHER]\nkey secret\n", b""),
    ):
        path.write_text(text)
        assert find_key(environment) == key
    path.write_text("[AUTH]\n[include missing.ini]\n")
    with pytest.raises(ResourceError, match=r"auth\.conf"):
        find_key(environment)
