"""Reaching an address: the one way in which connections begin that this side makes."""

from __future__ import annotations

import socket

from rtf.middleware.naming import authentication
from rtf.middleware.stream import Stream


def dial(host: str, port: int, patience: float, key: bytes) -> Stream:
    """A connection to an address, with the key proved where there is one, and nothing said yet.

    It waits no longer than ``patience`` seconds for anything. Raises OSError, UnicodeError for a host that is no name,
    and MiddlewareError for a peer that does not know the key.
    """
    connection = socket.create_connection((host, port), timeout=patience)
    connection.settimeout(None)
    stream = Stream(connection)
    try:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        stream.limit_waiting(patience)
        if key:
            authentication.connect(stream, key)
    except BaseException:
        stream.close()
        raise
    return stream
