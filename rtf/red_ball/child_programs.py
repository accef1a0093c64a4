"""The programs of the demonstration as children of this process, for those who find them missing."""

from __future__ import annotations

import subprocess
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rtf import clock
from rtf.errors import RtfError
from rtf.middleware.ports.remote import exists
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from rtf.middleware.ports.network import Network

#: How long a program may take to open its ports, and to end (s of the machine's clock).
_START, _END = 60.0, 10.0


class NotStartedError(RtfError, RuntimeError):
    """A program of the demonstration did not start."""


@contextmanager
def child_program(
    words: list[str], port: str, log: Path, *, network: Network, wait: Callable[[], None]
) -> Iterator[None]:
    """Run ``rtf WORDS`` while the block runs, from when its port is there.

    ``wait`` is called between two looks at the port, so that the robot's time can pass. The output goes to ``log``.
    Raises NotStartedError, with the last lines of the output.
    """
    with log.open("wb") as output:
        command = [sys.executable, "-P", "-m", "rtf", *words]
        program = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=output, stderr=output)
        try:
            deadline = clock.Deadline.after(_START)
            while not exists(network, Contact(port)):
                if program.poll() is not None or deadline.expired:
                    raise NotStartedError(f"rtf {' '.join(words[:2])} did not open {port}: {_last_lines(log)}")
                wait()
            yield
        finally:
            program.terminate()
            try:
                program.wait(_END)
            except subprocess.TimeoutExpired:
                program.kill()
                program.wait()


def _last_lines(log: Path) -> str:
    return "; ".join(log.read_text(encoding="utf-8", errors="replace").splitlines()[-3:]) or "it printed nothing"
