"""The keeper: the program that :mod:`~rtf.testing.isolation.launch` starts, with a child that is the fork server.

It loads nothing and runs no author's code: as a subreaper it ends all processes that are left when the fork server has
ended or was killed.
"""

from __future__ import annotations

import gc
import os
from typing import NoReturn

from rtf.testing.isolation import processes


def main() -> NoReturn:
    """Start the fork server, and keep it until it ends."""
    processes.adopt_orphans()
    keeper = os.getpid()
    pid = os.fork()
    if pid:
        os.close(processes.CHANNEL_FD)
        processes.keep(pid)
        os._exit(0)
    os.setpgid(0, 0)
    gc.disable()  # imports make many objects and no garbage
    from rtf.testing.isolation import fork_server

    gc.enable()
    fork_server.main(keeper)
