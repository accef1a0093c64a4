"""YARP's optional authentication: both ends of a connection prove that they know the same key.

It is enabled by a file ``auth.conf`` with a key in its section ``[AUTH]``. Each end signs a random number of the other,
so recorded messages cannot be replayed. What is sent afterwards is neither signed nor encrypted: this keeps strangers
out of a network, but does not prevent eavesdropping.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from rtf.bottle import to_string
from rtf.middleware.errors import ProtocolError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.middleware.carriers.stream import Stream

_FILE = "auth.conf"
_SECTION = "AUTH"
_NONCE = 8
_PROOF = 32


def find_key(environment: Mapping[str, str] | None = None) -> bytes:
    """Return the key of this process's network; empty if authentication is off. Raises ResourceError."""
    from rtf.resources import ResourceFinder, read_property_file

    path = ResourceFinder(environment=environment).search(_FILE).path
    if path is None:
        return b""
    section = read_property_file(path, environment=environment).properties.find_group(_SECTION)
    key = None if section is None else section.find("key")
    return b"" if key is None else to_string(key).encode("utf-8", "surrogateescape")


def accept(stream: Stream, key: bytes) -> None:
    """Authenticate both ends, on the called side. Raises ProtocolError if the caller has another key."""
    first = os.urandom(_NONCE)
    stream.send(first + _sign(key, first))
    second = _take(stream, key, first)
    third = os.urandom(_NONCE)
    stream.send(third + _sign(key, first + second + third))


def connect(stream: Stream, key: bytes) -> None:
    """Authenticate both ends, on the calling side. Raises ProtocolError if the port has another key."""
    first = _take(stream, key, b"")
    second = os.urandom(_NONCE)
    stream.send(second + _sign(key, first + second))
    _take(stream, key, first + second)


def _take(stream: Stream, key: bytes, before: bytes) -> bytes:
    """Read the peer's random number and verify its signature over it and all previous ones."""
    import hmac  # imported here: few networks have a key

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
