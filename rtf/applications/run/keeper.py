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

from rtf.applications.run.members import HELD_MARK, end_all, mark_of
from rtf.testing.isolation import processes

_PASSED_ON = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def fork_server(grace: float) -> int | None:
    """Fork the server. Return None in it; the keeper returns its exit code when the server and all else have ended.

    Called before there are threads. ``grace`` is how many seconds what is left has from SIGTERM to SIGKILL.
    """
    keeper = os.getpid()
    awaited = {signal.SIGCHLD, *(one for one in _PASSED_ON if signal.getsignal(one) is not signal.SIG_IGN)}
    before = signal.pthread_sigmask(signal.SIG_BLOCK, awaited)  # each waits until the keeper asks for it
    server = os.fork()
    if server:
        code = _keep(server, awaited, grace)
        while signal.sigtimedwait(awaited, 0) is not None:  # those that were for the server
            continue
    else:
        os.setpgid(0, 0)  # Ctrl-C goes to the keeper, which passes it on once
        processes.die_with_parent(signal.SIGTERM)
        if os.getppid() != keeper:  # it died in between
            os._exit(1)
    signal.pthread_sigmask(signal.SIG_SETMASK, before)
    return code if server else None


def _keep(server: int, awaited: set[signal.Signals], grace: float) -> int:
    processes.adopt_orphans()
    while (status := _reap(server)) is None:
        signum = signal.sigwait(awaited)
        if signum != signal.SIGCHLD:
            processes.signal_process(server, signum)
    end_all(_left, grace)
    exit_status, _ = processes.split_status(status)
    return 1 if exit_status is None else exit_status


def _reap(server: int) -> int | None:
    """Reap what has ended, and return the server's status if it has."""
    while True:
        pid, status = os.waitpid(-1, os.WNOHANG)
        if pid in (0, server):
            return status if pid else None


def _left() -> list[int]:
    """Reap what has ended, and return the descendants that are to end."""
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass
    return [pid for pid in processes.descendants_of(os.getpid()) if not mark_of(pid).startswith(f"{HELD_MARK}=")]
