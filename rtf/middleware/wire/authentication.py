"""YARP's optional authentication: both ends of a connection prove that they know the same key.

It is enabled by a file ``auth.conf`` with a key in its section ``[AUTH]``. Each end signs a random number of the other,
so recorded messages cannot be replayed. What is sent afterwards is neither signed nor encrypted: this keeps strangers
out of a network, but does not prevent eavesdropping.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from rtf.middleware.errors import ProtocolError

if TYPE_CHECKING:
    from rtf.middleware.wire.inbox import Inbox, Reading, Steps

_NONCE = 8
_PROOF = 32


def accept(inbox: Inbox, key: bytes) -> Steps[None]:
    """Authenticate both ends, on the called side. Raises ProtocolError if the caller has another key."""
    first = os.urandom(_NONCE)
    yield first + _sign(key, first)
    second = yield from _take(inbox, key, first)
    third = os.urandom(_NONCE)
    yield third + _sign(key, first + second + third)


def connect(inbox: Inbox, key: bytes) -> Steps[None]:
    """Authenticate both ends, on the calling side. Raises ProtocolError if the port has another key."""
    first = yield from _take(inbox, key, b"")
    second = os.urandom(_NONCE)
    yield second + _sign(key, first + second)
    yield from _take(inbox, key, first + second)


def _take(inbox: Inbox, key: bytes, before: bytes) -> Reading[bytes]:
    """Read the peer's random number and verify its signature over it and all previous ones."""
    import hmac  # imported here: few networks have a key

    message = bytes((yield from inbox.take(_NONCE + _PROOF)))
    nonce, proof = message[:_NONCE], message[_NONCE:]
    if not hmac.compare_digest(proof, _sign(key, before + nonce)):
        raise ProtocolError(
            "the peer does not know the key of this network; compare 'key' in the [AUTH] of both auth.conf"
        )
    return nonce


def _sign(key: bytes, data: bytes) -> bytes:
    import hmac

    return hmac.digest(key, data, "sha256")
