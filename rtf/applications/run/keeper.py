"""The keeper of a node: the parent process of the server, which ends what a killed server leaves.

A server that gets SIGKILL cannot end its children, and no kernel service ends their children. The keeper is the process
that the user starts and signals. It passes signals on, adopts and reaps orphans, and when the server has ended, it ends
all descendants that are left, except held ones. When the keeper itself is killed, the kernel sends SIGTERM to the
server. When both are killed at once, the next node of the name ends what is left (:mod:`~rtf.applications.run.record`).
"""

from __future__ import annotations

import contextlib
import os
import signal
from typing import TYPE_CHECKING

from rtf.applications.run.members import HELD_MARK, end_all, mark_of
from rtf.testing.isolation import processes

if TYPE_CHECKING:
    from types import FrameType

_PASSED_ON = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def fork_server(grace: float) -> int | None:
    """Fork the server. Return None in it; the keeper returns its exit code when the server and all else have ended.

    Called before there are threads. ``grace`` is how many seconds what is left has from SIGTERM to SIGKILL.
    """
    keeper = os.getpid()
    server = os.fork()
    if server:
        return _keep(server, grace)
    os.setpgid(0, 0)  # Ctrl-C goes to the keeper, which passes it on once
    processes.die_with_parent(signal.SIGTERM)
    if os.getppid() != keeper:  # it died in between
        os._exit(1)
    return None


def _keep(server: int, grace: float) -> int:
    def pass_on(signum: int, _frame: FrameType | None) -> None:
        processes.signal_process(server, signum)

    processes.adopt_orphans()
    for signum in _PASSED_ON:
        if signal.getsignal(signum) is not signal.SIG_IGN:
            signal.signal(signum, pass_on)
    pid = status = 0
    while pid != server:
        pid, status = os.wait()
    end_all(_left, grace)
    exit_status, _ = processes.split_status(status)
    return 1 if exit_status is None else exit_status


def _left() -> list[int]:
    """Reap what has ended, and return the descendants that are to end."""
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass
    return [pid for pid in processes.descendants_of(os.getpid()) if not mark_of(pid).startswith(f"{HELD_MARK}=")]
