"""TCPROS on bytes: headers of connections, and messages behind their lengths. It knows no sockets.

A connection begins with a header of each side: fields ``key=value`` behind their lengths, little-endian. Then a
publisher sends messages; a service answers requests, each response behind a byte that says whether it succeeded.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from rtf.ros1.errors import PeerError

if TYPE_CHECKING:
    from rtf.middleware.wire.inbox import Inbox, Reading

#: The longest header that is accepted: it has the definition of a type.
MAX_HEADER = 1 << 20
#: The longest message that is accepted, unless a node has another limit.
MAX_MESSAGE = 64 << 20
_length = struct.Struct("<I")


def encode_header(fields: dict[str, str]) -> bytes:
    """Return the bytes of a header, its fields in the order of their keys."""
    parts = [f"{key}={fields[key]}".encode() for key in sorted(fields)]
    body = b"".join(_length.pack(len(part)) + part for part in parts)
    return _length.pack(len(body)) + body


def decode_header(body: bytes) -> dict[str, str]:
    """Return the fields of a header whose length has been read. Raises PeerError."""
    fields: dict[str, str] = {}
    start = 0
    while start < len(body):
        begin = start + _length.size
        if begin > len(body):
            raise PeerError("a header ends in the length of a field")
        end = begin + _length.unpack_from(body, start)[0]
        if end > len(body):
            raise PeerError(f"a field of {end - begin} bytes in a header with {len(body) - begin} left")
        key, sign, value = body[begin:end].partition(b"=")
        if not sign or not key:
            raise PeerError(f"a field of a header is key=value, not {body[begin:end][:80]!r}")
        try:
            fields[key.decode()] = value.decode()
        except UnicodeDecodeError:
            raise PeerError(f"the field {key[:80]!r} of a header is no text") from None
        start = end
    return fields


def read_header(inbox: Inbox) -> Reading[dict[str, str]]:
    """Read a header. Raises PeerError."""
    (size,) = _length.unpack((yield from inbox.take(_length.size)))
    if size > MAX_HEADER:
        raise PeerError(f"a header of {size} bytes; at most {MAX_HEADER} are accepted")
    return decode_header(bytes((yield from inbox.take(size))))


def frame(message: bytes | memoryview) -> bytes:
    """Return a message behind its length."""
    return _length.pack(len(message)) + message


def read_message(inbox: Inbox, limit: int) -> Reading[memoryview]:
    """Read a message, which is valid until more is read, or if it is large, while it is referred to.

    Raises PeerError for more than ``limit`` bytes.
    """
    (size,) = _length.unpack((yield from inbox.take(_length.size)))
    if size > limit:
        raise PeerError(f"a message of {size} bytes; at most {limit} are accepted")
    return (yield from inbox.take(size))


def encode_response(succeeded: bool, body: bytes | memoryview) -> bytes:
    """Return the response of a service: a message, or the text of an error."""
    return bytes([succeeded]) + frame(body)


def read_response(inbox: Inbox, limit: int) -> Reading[tuple[bool, bytes]]:
    """Read the response of a service: whether it succeeded, and a message or the text of an error."""
    succeeded = bool((yield from inbox.take(1))[0])
    return succeeded, bytes((yield from read_message(inbox, limit)))
