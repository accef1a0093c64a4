"""Starts the processes of a fork server. The command line does this first and loads the rest meanwhile.

Two processes are started: the keeper, and its child, the fork server. So the one that launches is changed in no way.
"""

from __future__ import annotations

import os
import signal
import socket
import sys
from dataclasses import dataclass

from rtf.testing.isolation import processes
from rtf.testing.isolation.processes import CHANNEL_FD, DUMP_FD

_CODE = "import sys; sys.path[:] = {path!r}; from rtf.testing.isolation import keeper; keeper.main()"


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
