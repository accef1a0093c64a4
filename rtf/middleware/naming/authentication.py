"""YARP's optional proof that both ends of a connection know the same key, before anything else is said.

It is done when a file ``auth.conf`` is found that has a key in its section ``[AUTH]``. Each end shows that it can
sign what the other has just made up, so nothing that was recorded is of use again. What is said afterwards is neither
signed nor encrypted: this keeps strangers out of a network, and nobody from listening.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from rtf.bottle import to_string
from rtf.middleware.errors import ProtocolError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.middleware.stream import Stream

_FILE = "auth.conf"
_SECTION = "AUTH"
_NONCE = 8
_PROOF = 32


def find_key(environment: Mapping[str, str] | None = None) -> bytes:
    """The key of this process's network; empty when connections prove nothing. Raises ResourceError."""
    from rtf.resources import ResourceFinder, read_property_file

    path = ResourceFinder(environment=environment).search(_FILE).path
    if path is None:
        return b""
    section = read_property_file(path, environment=environment).properties.find_group(_SECTION)
    key = None if section is None else section.find("key")
    return b"" if key is None else to_string(key).encode("utf-8", "surrogateescape")


def accept(stream: Stream, key: bytes) -> None:
    """Prove and be proven to, at the end that was called. Raises ProtocolError when the caller has another key."""
    first = os.urandom(_NONCE)
    stream.send(first + _sign(key, first))
    second = _take(stream, key, first)
    third = os.urandom(_NONCE)
    stream.send(third + _sign(key, first + second + third))


def connect(stream: Stream, key: bytes) -> None:
    """Prove and be proven to, at the end that calls. Raises ProtocolError when the port has another key."""
    first = _take(stream, key, b"")
    second = os.urandom(_NONCE)
    stream.send(second + _sign(key, first + second))
    _take(stream, key, first + second)


def _take(stream: Stream, key: bytes, before: bytes) -> bytes:
    """A number that the peer made up, and its proof over this and all before."""
    import hmac  # few networks have a key

    message = bytes(stream.take(_NONCE + _PROOF))
    nonce, proof = message[:_NONCE], message[_NONCE:]
    if not hmac.compare_digest(proof, _sign(key, before + nonce)):
        raise ProtocolError(
            "the peer does not know the key of this network; compare 'key' in the [AUTH] of both auth.conf"
        )
    return nonce


def _sign(key: bytes, data: bytes) -> bytes:
    import hmac

    return hmac.digest(key, data, "sha256")
