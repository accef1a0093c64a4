"""Starts the process of a fork server. The command line does this first and loads the rest meanwhile."""

from __future__ import annotations

import fcntl
import os
import socket
import sys
from dataclasses import dataclass

from rtf import clock
from rtf.testing.isolation.fork_server_protocol import CONTROL_FD, DUMP_FD

_FIRST_DESCRIPTOR = 10  # above those that the new process finds its files on


@dataclass(frozen=True, slots=True)
class Launched:
    """A fork server's process, the runner's end of its socket, and the file it dumps stacks into.

    ``mark`` is the environment entry by which its descendants can be told from all others.
    """

    pid: int
    control: socket.socket
    dump: int
    mark: str


def launch() -> Launched:
    """Start a fork server without waiting for it. It ends when ``control`` is closed, or this process dies."""
    here, there = socket.socketpair()
    dump = os.memfd_create("rtf-stacks")
    mark = f"RTF_FORK_SERVER={os.getpid()}-{clock.monotonic()}"
    name, _, value = mark.partition("=")
    code = (
        f"import sys; sys.path[:] = {sys.path!r}; from rtf.testing.isolation import forking; forking.watch_hooks(); "
        "from rtf.testing.isolation import fork_server; fork_server.main()"
    )
    inherited = [
        fcntl.fcntl(descriptor, fcntl.F_DUPFD_CLOEXEC, _FIRST_DESCRIPTOR) for descriptor in (there.fileno(), dump)
    ]
    try:
        pid = os.posix_spawn(
            sys.executable,
            [sys.executable, "-P", "-c", code],
            {**os.environ, name: value},
            file_actions=[
                (os.POSIX_SPAWN_OPEN, 0, os.devnull, os.O_RDONLY, 0),
                (os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0),
                (os.POSIX_SPAWN_DUP2, inherited[0], CONTROL_FD),
                (os.POSIX_SPAWN_DUP2, inherited[1], DUMP_FD),
            ],
            setsid=True,
        )
    finally:
        there.close()
        for descriptor in inherited:
            os.close(descriptor)
    return Launched(pid, here, dump, mark)
