"""Processes on Linux: how one is tied to its parent, who its descendants are, how a whole group is ended.

The isolation of tests, fixtures and simulators rests on these few kernel services; everything else is built on them.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import select
import signal
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

#: The files of a process of RTF beside 0, 1 and 2: its channel, which is the control socket of a fork server, and the
#: file for its stacks.
CHANNEL_FD = 3
DUMP_FD = 4

_PR_SET_PDEATHSIG = 1
_PR_SET_CHILD_SUBREAPER = 36

_libc = ctypes.CDLL(None, use_errno=True)


def _prctl(option: int, argument: int) -> None:
    if _libc.prctl(option, argument, 0, 0, 0) != 0:
        number = ctypes.get_errno()
        raise OSError(number, f"prctl({option}): {os.strerror(number)}")


def die_with_parent(signum: int = signal.SIGKILL) -> None:
    """Have the kernel send ``signum`` to this process when the thread that made it ends, however it ends."""
    _prctl(_PR_SET_PDEATHSIG, signum)


def adopt_orphans() -> None:
    """Become the new parent of descendants whose own parent dies, so that none can get away."""
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)


@contextlib.contextmanager
def named(name: str) -> Iterator[None]:
    """Rename this process in the block; other processes read the name with :func:`name_of`."""
    before = name_of(os.getpid())
    _name_this(name)
    try:
        yield
    finally:
        _name_this(before)


def _name_this(name: str) -> None:
    with contextlib.suppress(OSError), open("/proc/self/comm", "w") as stream:  # noqa: PTH123
        stream.write(name)


def name_of(pid: int) -> str:
    """Return the kernel's name of a process, 15 bytes at most; empty when it is gone."""
    try:
        with open(f"/proc/{pid}/comm", encoding="utf-8", errors="replace") as stream:  # noqa: PTH123
            return stream.read().rstrip("\n")
    except OSError:
        return ""


def reap(pid: int) -> tuple[int, float, int]:
    """Reap a child that has ended: its wait status, its CPU time in seconds, its peak memory in bytes."""
    _, status, usage = os.wait4(pid, 0)
    return status, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024


def keep(child: int) -> None:
    """Wait for a child, then end all descendants of this process, a subreaper."""
    os.waitid(os.P_PID, child, os.WEXITED | os.WNOWAIT)
    while True:
        for pid in descendants_of(os.getpid()):
            signal_process(pid, signal.SIGKILL)
        try:
            os.wait()
        except ChildProcessError:
            return


def ends_within(pid: int, timeout: float | None) -> bool:
    """Wait for a child of this process to end. False when it does not within ``timeout`` seconds. It is not reaped."""
    pidfd = os.pidfd_open(pid)
    try:
        poll = select.poll()  # not select(), which fails where many files are open
        poll.register(pidfd, select.POLLIN)
        return bool(poll.poll(None if timeout is None else timeout * 1000))
    finally:
        os.close(pidfd)


def await_exit(pid: int, timeout: float | None) -> bool:
    """Wait for a child of this process to end, and reap it. False when it does not within ``timeout`` seconds."""
    if not ends_within(pid, timeout):
        return False
    os.waitpid(pid, 0)
    return True


def children_of(pid: int) -> list[int]:
    """The living and unreaped children of a process, of all its threads; empty when it is gone."""
    gone = (FileNotFoundError, ProcessLookupError)
    found: list[int] = []
    threads: list[str] = []
    with contextlib.suppress(*gone):
        threads = os.listdir(f"/proc/{pid}/task")  # noqa: PTH208 - names only
    for thread in threads:
        with contextlib.suppress(*gone), open(f"/proc/{pid}/task/{thread}/children", "rb") as stream:  # noqa: PTH123
            found.extend(int(word) for word in stream.read().split())
    return found


def descendants_of(pid: int) -> list[int]:
    """All processes below ``pid``, nearest first."""
    found: list[int] = []
    level = children_of(pid)
    while level:
        found.extend(level)
        level = [child for parent in level for child in children_of(parent) if child not in found]
    return found


def carries(pid: int, mark: str) -> bool:
    """Whether a process was started with the environment entry ``mark`` (``NAME=value``)."""
    try:
        with open(f"/proc/{pid}/environ", "rb") as stream:  # noqa: PTH123
            return mark.encode() in stream.read().split(b"\0")
    except OSError:
        return False


def signal_group(pid: int, signum: int) -> bool:
    """Send a signal to the process group led by ``pid``, or to it alone where it leads none. False when it is gone."""
    try:
        os.killpg(pid, signum)
    except ProcessLookupError:
        return signal_process(pid, signum)
    except PermissionError:
        return False
    return True


def signal_process(pid: int, signum: int) -> bool:
    """Send a signal to one process. False when it is gone or not ours."""
    try:
        os.kill(pid, signum)
    except (ProcessLookupError, PermissionError):
        return False
    return True


def signal_name(number: int) -> str:
    """The name of a signal, such as ``SIGSEGV``; ``signal 35`` for one that has none."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def split_status(wait_status: int) -> tuple[int | None, str]:
    """Return exit status and signal name of a status from ``wait``; one of the two is empty."""
    if os.WIFSIGNALED(wait_status):
        return None, signal_name(os.WTERMSIG(wait_status))
    return os.WEXITSTATUS(wait_status), ""


def describe_end(exit_status: int | None, signal_text: str) -> str:
    """Say how a process ended, such as ``killed by SIGSEGV`` or ``exit status 3``."""
    return f"killed by {signal_text}" if signal_text else f"exit status {exit_status}"


def limit_memory(limit: int) -> None:
    """Make allocations of this process fail beyond ``limit`` bytes of private memory, to protect the machine."""
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))


def no_core_dumps() -> None:
    """Write no core files, because a run may contain a hundred crashes; programs of tests may write them on request."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))


def prefer_for_oom_kill() -> None:
    """Make the kernel kill this process and its children first when the machine runs out of memory."""
    with contextlib.suppress(OSError), open("/proc/self/oom_score_adj", "w") as stream:  # noqa: PTH123
        stream.write("500")


def kernel_state(pid: int) -> str:
    """Return a process's state in the kernel and where it waits, for a process that cannot report itself."""
    lines = []
    for name in ("status", "wchan", "syscall"):
        with contextlib.suppress(OSError), open(f"/proc/{pid}/{name}") as stream:  # noqa: PTH123
            text = stream.read(4096)
            if name == "status":
                text = "\n".join(line for line in text.splitlines() if line.startswith(("Name", "State", "Sig")))
            lines.append(f"{name}: {text.strip()}")
    return "\n".join(lines)
