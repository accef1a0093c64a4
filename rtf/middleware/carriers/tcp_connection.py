"""Outgoing TCP connections: every connection that this process initiates is opened here."""

from __future__ import annotations

import socket

from rtf.middleware.carriers.stream import Stream
from rtf.middleware.wire import authentication


def open_stream(host: str, port: int, patience: float, key: bytes) -> Stream:
    """Open a connection to an address and authenticate it if there is a key. Nothing else is sent.

    No single wait takes longer than ``patience`` seconds. Raises OSError, UnicodeError for an invalid host name, and
    MiddlewareError if the peer does not know the key.
    """
    connection = socket.create_connection((host, port), timeout=patience)
    connection.settimeout(None)
    stream = Stream(connection)
    try:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        stream.limit_waiting(patience)
        if key:
            stream.run(authentication.connect(stream, key))
    except BaseException:
        stream.close()
        raise
    return stream
