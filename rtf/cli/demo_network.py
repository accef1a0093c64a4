"""Two programs that talk, for the demonstration: a name server and a writer here, a reader in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from typing import TYPE_CHECKING

from rtf import clock

if TYPE_CHECKING:
    from rtf.middleware.network import Network

_SAYING = '[set] [pos] 0 12.5 "two words"'
_QUESTIONS = 50
_PATIENCE = 20.0


def talk() -> list[str]:
    """Have two programs talk over a network of their own; returns what happened, a line each.

    Raises MiddlewareError, or OSError, when they do not understand each other.
    """
    from rtf.middleware.errors import ProtocolError
    from rtf.middleware.naming.client import RemoteNames
    from rtf.middleware.naming.configuration import write_place
    from rtf.middleware.naming.server import NameServer
    from rtf.middleware.network import Network

    with tempfile.TemporaryDirectory() as folder, NameServer() as server:
        environment = {**os.environ, "YARP_CONFIG_HOME": folder}
        write_place(server.contact, environment=environment)
        command = [sys.executable, "-m", "rtf.cli.tools", "read", "/demo/reader", "once"]
        names = RemoteNames(server.contact)
        try:
            with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as reader:
                try:
                    lines = _write(Network(names), reader.pid)
                    heard, _ = reader.communicate(timeout=_PATIENCE)
                finally:
                    reader.kill()
        finally:
            names.close()
        if heard.strip() != _SAYING:
            raise ProtocolError(f"the reader was sent {_SAYING!r} and printed {heard.strip()!r}")
        return [*lines, f"  process {reader.pid} printed what it was sent: {heard.strip()}"]


def _write(network: Network, reader: int) -> list[str]:
    from rtf.bottle import Bottle
    from rtf.middleware import remote
    from rtf.middleware.errors import ConnectError
    from rtf.middleware.names import Contact
    from rtf.middleware.port import Port
    from rtf.testing.statistics import median

    target = Contact(name="/demo/reader")
    deadline = clock.Deadline.after(_PATIENCE)
    while not remote.exists(network, target):
        if deadline.expired:
            raise ConnectError(f"/demo/reader, which process {reader} should open, is not there")
        clock.sleep(0.02)
    times = []
    for _ in range(_QUESTIONS):
        began = clock.monotonic()
        remote.administer(network, target, Bottle.parse("[ver]"))
        times.append(clock.monotonic() - began)
    with Port("/demo/writer", network=network, inputs=False) as writer:
        found = writer.add_output("/demo/reader", "tcp")
        writer.write(Bottle.parse(_SAYING))
    return [
        f"Two programs talk as YARP's do: /demo/writer here, /demo/reader in process {reader} ({found.by('tcp')})",
        f"  a connection, a question and its answer take {median(times) * 1e3:.2f} ms",
    ]
