"""Starts the processes of a fork server. The command line does this first and loads the rest meanwhile.

Two processes are started. The keeper loads nothing and runs no author's code: as a subreaper it ends all processes that
are left when its child, the fork server, has ended or was killed. So the process that launches is changed in no way.
"""

from __future__ import annotations

import gc
import os
import signal
import socket
import sys
from dataclasses import dataclass
from typing import NoReturn

from rtf.testing.isolation import processes

#: The files of a process of RTF beside 0, 1 and 2: its channel, which is the control socket of a fork server, and the
#: file for its stacks.
CHANNEL_FD = 3
DUMP_FD = 4

_CODE = "import sys; sys.path[:] = {path!r}; from rtf.testing.isolation import launch; launch.main()"


@dataclass(frozen=True, slots=True)
class Launched:
    """A fork server: the process of its keeper, and the runner's end of its socket."""

    keeper: int
    control: socket.socket

    def resume(self) -> None:
        """Continue the processes, in case they were stopped by a signal."""
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
    with there:
        pid = os.posix_spawn(
            sys.executable,
            [sys.executable, "-P", "-c", _CODE.format(path=sys.path)],
            os.environ,
            file_actions=[
                (os.POSIX_SPAWN_DUP2, there.fileno(), CHANNEL_FD),  # first: no other file is on its number yet
                (os.POSIX_SPAWN_OPEN, 0, os.devnull, os.O_RDONLY, 0),
                (os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0),
                (os.POSIX_SPAWN_OPEN, DUMP_FD, os.devnull, os.O_WRONLY, 0),
            ],
            setsid=True,
        )
    return Launched(pid, here)


def main() -> NoReturn:
    """Run the keeper, with a child that is the fork server: the program that :func:`launch` starts."""
    processes.adopt_orphans()
    keeper = os.getpid()
    pid = os.fork()
    if pid:
        os.close(CHANNEL_FD)
        processes.keep(pid)
        os._exit(0)
    os.setpgid(0, 0)
    gc.disable()  # imports make many objects and no garbage
    from rtf.testing.isolation import fork_server

    gc.enable()
    fork_server.main(keeper)
