"""Ports that nobody has, for a program that is told its port, or that has to find it closed."""

from __future__ import annotations

import secrets
import socket

#: Below the ports that Linux gives to whoever does not choose one, such as all other ports of tests: none of these gets
#: the number between the look here and the use there.
_FIRST, _LAST = 20000, 32000
_ATTEMPTS = 100


def free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    """Return a TCP port of 127.0.0.1 that nobody has; with ``SOCK_DGRAM`` a UDP port."""
    for _ in range(_ATTEMPTS):
        number = _FIRST + secrets.randbelow(_LAST - _FIRST)
        with socket.socket(socket.AF_INET, kind) as probe:
            try:
                probe.bind(("127.0.0.1", number))
            except OSError:
                continue
            return number
    raise AssertionError(f"no port of {_FIRST} to {_LAST} is free")
