"""The processes of a child: its process group, and those that left it but carry its mark in their environment.

A program that forks and exits, or a shell that is killed, leaves processes behind that belong to the same tag. They
are found by the kernel's lists, which cost some milliseconds and are therefore read only when something has ended.
"""

from __future__ import annotations

import os
import signal
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf import clock
from rtf.testing.isolation import processes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

#: The variable of the mark. Children that outlive their node have the second one, which the keeper spares.
MARK, HELD_MARK = "RTF_RUN_CHILD", "RTF_RUN_HELD"
#: The flag of the kernel's own threads, PF_KTHREAD of linux/sched.h.
_KERNEL = 0x00200000
#: Seconds between two looks at a process that has no environment, as in the middle of ``exec``, and their number.
_EXEC, _LOOKS = 0.001, 3
#: Seconds between two looks at what is ending.
_LOOK = 0.05
_STATE, _GROUP, _FLAGS, _START = 0, 2, 6, 19  # places in /proc/PID/stat behind the name, see proc(5)


@dataclass(frozen=True, slots=True)
class ProcessState:
    """A process: its group, and when it was started, in ticks since the machine was."""

    pid: int
    group: int
    started: int
    zombie: bool
    of_kernel: bool


def look_at(pid: int) -> ProcessState | None:
    """Return the state of a process; None if it is gone."""
    try:
        with open(f"/proc/{pid}/stat", "rb") as stream:  # noqa: PTH123
            words = stream.read().rpartition(b")")[2].split()
    except OSError:
        return None
    zombie, of_kernel = words[_STATE] in (b"Z", b"X"), bool(int(words[_FLAGS]) & _KERNEL)
    return ProcessState(pid, int(words[_GROUP]), int(words[_START]), zombie, of_kernel)


def lives(process: ProcessState) -> bool:
    """Return whether a process still lives, and its number has not gone to another one."""
    now = look_at(process.pid)
    return now is not None and not now.zombie and now.started == process.started


def all_processes() -> Iterator[ProcessState]:
    """All processes of the machine that live, without the threads of the kernel."""
    for name in os.listdir("/proc"):  # noqa: PTH208 - names only
        found = look_at(int(name)) if name.isdecimal() else None
        if found is not None and not (found.zombie or found.of_kernel):
            yield found


def mark_of(pid: int) -> str:
    """Return the mark with which a process was started, ``NAME=value``; empty if it has none, or is not ours."""
    environment = _environment(pid)
    for name in (MARK, HELD_MARK):
        start = environment.find(f"{name}=".encode())
        if start == 0 or (start > 0 and environment[start - 1] == 0):
            return environment[start:].split(b"\0", 1)[0].decode("utf-8", "replace")
    return ""


def _environment(pid: int) -> bytes:
    for _ in range(_LOOKS):
        try:
            with open(f"/proc/{pid}/environ", "rb") as stream:  # noqa: PTH123
                environment = stream.read()
        except OSError:
            return b""
        if environment:
            return environment
        clock.sleep(_EXEC)
    return b""


def members(groups: Iterable[tuple[int, str]]) -> dict[int, list[ProcessState]]:
    """Return the living processes of each child. A child is its group's number and its mark."""
    groups = [*groups]
    by_group = {group: group for group, _ in groups}
    by_mark = {mark: group for group, mark in groups}
    found: dict[int, list[ProcessState]] = {group: [] for group in by_group}
    for process in all_processes():
        group = by_group.get(process.group) or by_mark.get(mark_of(process.pid))
        if group:
            found[group].append(process)
    return found


def end_all(find: Callable[[], Iterable[int]], grace: float) -> list[int]:
    """End the processes that ``find`` returns, until it returns none: SIGTERM, then SIGKILL after ``grace`` seconds.

    Returns those that were there.
    """
    deadline = clock.Deadline.after(grace)
    asked: dict[int, None] = {}
    while left := [*find()]:
        for pid in left:
            if deadline.expired:
                processes.signal_process(pid, signal.SIGKILL)
            elif pid not in asked:
                processes.signal_process(pid, signal.SIGTERM)
                processes.signal_process(pid, signal.SIGCONT)
            asked[pid] = None
        clock.sleep(_LOOK)
    return [*asked]
