"""Starts the processes of a fork server. The command line does this first and loads the rest meanwhile.

Two processes are started. The keeper loads nothing and runs no author's code: as a subreaper it ends whatever is left
when the fork server, its child, has ended or was killed. So the process that launches is changed in no way.
"""

from __future__ import annotations

import fcntl
import os
import signal
import socket
import sys
from dataclasses import dataclass
from typing import NoReturn

from rtf.testing.isolation import processes

#: Where a fork server finds its files, beside 0, 1 and 2: the file for stacks, and the socket to the runner.
DUMP_FD = 4
CONTROL_FD = 5
_FIRST_DESCRIPTOR = 10  # above those that the new process finds its files on

_CODE = "import sys; sys.path[:] = {path!r}; from rtf.testing.isolation import launch; launch.main()"


@dataclass(frozen=True, slots=True)
class Launched:
    """A fork server: the process of its keeper, the runner's end of its socket, and the file it dumps stacks into."""

    keeper: int
    control: socket.socket
    dump: int

    def resume(self) -> None:
        """Let its processes go on, should somebody have stopped one."""
        for pid in (self.keeper, *processes.children_of(self.keeper)):
            processes.signal_process(pid, signal.SIGCONT)

    def kill(self) -> None:
        """Kill the fork server; the keeper then ends all that is left, and itself."""
        self.resume()
        for pid in processes.children_of(self.keeper):
            processes.signal_process(pid, signal.SIGKILL)


def launch() -> Launched:
    """Start a fork server without waiting for it. It ends when ``control`` is closed, or this process dies."""
    here, there = socket.socketpair()
    dump = os.memfd_create("rtf-stacks")
    inherited = [
        fcntl.fcntl(descriptor, fcntl.F_DUPFD_CLOEXEC, _FIRST_DESCRIPTOR) for descriptor in (there.fileno(), dump)
    ]
    try:
        pid = os.posix_spawn(
            sys.executable,
            [sys.executable, "-P", "-c", _CODE.format(path=sys.path)],
            os.environ,
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
    return Launched(pid, here, dump)


def main() -> NoReturn:
    """Be the keeper, and have a child be the fork server: what the interpreter that :func:`launch` starts does."""
    processes.adopt_orphans()
    keeper = os.getpid()
    pid = os.fork()
    if pid:
        os.closerange(DUMP_FD, CONTROL_FD + 1)
        processes.keep(pid)
        os._exit(0)
    os.setpgid(0, 0)
    from rtf.testing.isolation import fork_server

    fork_server.main(keeper)
