"""Clients of the live page, many of them in this one process: each follows the run and throws away what it reads.

``python many_clients.py NUMBER COMMAND…`` starts a run, connects to the address it prints as soon as it is there, and
ends as the run does. NUMBER 0 starts the run alone, the same way.
"""

from __future__ import annotations

import os
import re
import selectors
import socket
import subprocess
import sys

_ADDRESS = re.compile(r"web page: http://([^:/]+):(\d+)/")
_READ = 1 << 16


def connect(said: str) -> socket.socket:
    """One client, from the beginning of the run that said where its page is."""
    found = _ADDRESS.search(said)
    if found is None:
        raise RuntimeError(f"no address was printed: {said}")
    host, port = found[1], int(found[2])
    client = socket.create_connection((host, port))
    client.sendall(f"GET /events HTTP/1.1\r\nHost: {host}:{port}\r\n\r\n".encode())
    client.setblocking(False)
    return client


def main(number: int, command: list[str]) -> None:
    """Run the command with so many clients, each of which must get something; raises when that fails."""
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    os.nice(10)  # browsers are on other machines, or at least not what is measured
    said = process.stderr.readline() if number else ""
    read: dict[int, int] = {}
    with selectors.DefaultSelector() as selector:
        for _ in range(number):
            selector.register(connect(said), selectors.EVENT_READ)
        while selector.get_map():
            for key, _ in selector.select():
                client: socket.socket = key.fileobj  # type: ignore[assignment]
                data = client.recv(_READ)
                read[key.fd] = read.get(key.fd, 0) + len(data)
                if not data:
                    selector.unregister(client)
    said += process.communicate()[1]
    if process.returncode != 0 or len(read) != number or not all(read.values()):
        raise RuntimeError(f"exit code {process.returncode}; the clients got {sorted(read.values())} bytes: {said}")


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2:])
