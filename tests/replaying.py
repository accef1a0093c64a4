"""Recorded conversations of real programs, replayed against our ports: one end is the recording, the other a port."""

from __future__ import annotations

import json
import threading
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtf.bottle import Dialect

if TYPE_CHECKING:
    import socket
    from collections.abc import Iterator

    #: What was said: which way it went (``>`` from the one that connected, ``<`` to it), and its bytes.
    Segment = tuple[str, bytes]

_DATA = Path(__file__).parent / "data" / "yarp_wire"
#: The releases of YARP that were recorded, and what they speak.
VERSIONS = {"3.12.3": Dialect.YARP3, "4.0.0": Dialect.YARP4}
#: Seconds in which the other end connects, and says what it has to say.
_PATIENCE = 10.0


def recordings(version: str, file: str) -> dict[str, Any]:
    """Everything in one file of a release's recordings."""
    return json.loads((_DATA / version / file).read_text(encoding="utf-8"))


def segments(conversation: list[list[str]]) -> list[Segment]:
    """A conversation as it is stored, with the bytes of each side."""
    return [(way, bytes.fromhex(data)) for way, data in conversation]


def receive(connection: socket.socket, size: int) -> bytes:
    """Receive this number of bytes, or fewer if the connection ends."""
    data = b""
    while len(data) < size and (part := connection.recv(size - len(data))):
        data += part
    return data


@contextmanager
def playing(listening: socket.socket, talk: list[Segment]) -> Iterator[list[tuple[bytes, bytes]]]:
    """Play the recorded server in a thread; when the block ends, compare what was sent to it."""
    sent: list[tuple[bytes, bytes]] = []
    listening.settimeout(_PATIENCE)
    thread = threading.Thread(target=_play, args=(listening, talk, sent), daemon=True)
    thread.start()
    try:
        yield sent
    finally:
        thread.join(_PATIENCE)


def _play(listening: socket.socket, talk: list[Segment], sent: list[tuple[bytes, bytes]]) -> None:
    try:
        connection, _ = listening.accept()
    except TimeoutError:  # the test failed before it connected, or else misses what should have been sent
        return
    with connection:
        connection.settimeout(_PATIENCE)
        for way, data in talk:
            if way == "<":
                connection.sendall(data)
            else:
                sent.append((data, receive(connection, len(data))))
