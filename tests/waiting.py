"""Waiting for other threads and processes until a condition holds."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import TYPE_CHECKING

import psutil

from rtf import clock

if TYPE_CHECKING:
    from collections.abc import Callable


def alive(pid: int) -> bool:
    """Whether a process lives, as more than a zombie; it may end while it is asked for."""
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def open_descriptors() -> int:
    """Return the number of descriptors of this process; the one that is used for counting is always included."""
    return len([*Path("/proc/self/fd").iterdir()])


def eventually(condition: Callable[[], object], complaint: str, limit: float = 10.0) -> None:
    """Wait until a condition holds."""
    deadline = clock.Deadline.after(limit)
    while not condition():
        if deadline.expired:
            raise AssertionError(f"{complaint}: {[thread.name for thread in threading.enumerate()]}")
        clock.sleep(0.002)
