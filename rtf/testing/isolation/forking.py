"""Which fork the fork server uses: the C library's own where that is enough, else Python's.

``os.fork`` fixes, in the child, what *other* threads may have been in the middle of: new locks for the interpreter and
the import system, new thread tables, and the hooks of ``os.register_at_fork`` (``threading``, ``random``, ``logging``
have some). That touches some 150 pages of memory, which the kernel has to copy: as much work as all the rest of a small
test. In a process with a single thread, which is the one that forks, there is nothing to fix: nobody holds a lock, and
the one thread keeps its identity (``pthread_self``). So the plain ``fork`` is used if there is one thread and no hook.
The child may then import and use ``threading`` and whatever else it likes. The interpreter's lock is held over the
call, as in ``os.fork``, and the C library's own hooks (``pthread_atfork``) run with either.
"""

from __future__ import annotations

import ctypes
import os
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

#: Modules of the standard library that register a hook when they are imported.
_WITH_HOOKS = frozenset({"threading", "random", "logging", "concurrent.futures.thread"})

_hooks: list[object] = []


def watch_hooks() -> None:
    """Take note from now on of who wants to hear of forks; the interpreter keeps its list for itself.

    To be called before anything is imported that might register.
    """
    _hooks.extend(_WITH_HOOKS & sys.modules.keys())
    register = os.register_at_fork

    def register_at_fork(**hooks: Callable[[], object]) -> None:
        _hooks.append(hooks)
        register(**hooks)

    os.register_at_fork = register_at_fork  # type: ignore[assignment]  # it takes more than it needs


def choose_fork() -> Callable[[], int]:
    """The function by which this process is to fork as long as it imports nothing and starts no thread.

    It returns the child's process id, 0 in the child, and (the plain one) -1 when there is no memory.
    """
    threads = len(os.listdir("/proc/self/task"))  # noqa: PTH208 - names only
    if _hooks or threads > 1 or sys.implementation.name != "cpython":
        return os.fork
    plain: Callable[[], int] = ctypes.PyDLL(None).fork
    return plain
