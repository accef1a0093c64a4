"""Questions by which a fixture finds out whether a program is there for others: a port, a file, another program.

Each answers yes or no in a bounded time and changes nothing; ``str()`` of a probe says what is missing when it is no.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
from typing import TYPE_CHECKING

from rtf.testing.isolation import processes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

_LARGEST_PORT = 65535


class PortProbe:
    """A TCP port accepts a connection. ``text`` is ``port`` (of 127.0.0.1) or ``host:port``; ValueError if neither."""

    def __init__(self, text: str) -> None:
        host, _, port = text.strip().rpartition(":")
        if not port.isascii() or not port.isdigit() or not 0 < int(port) <= _LARGEST_PORT:
            raise ValueError(f"{text!r} is no TCP port; write host:port, such as 127.0.0.1:10000, or the port alone")
        self.host = host.strip("[]") or "127.0.0.1"
        self.port = int(port)

    def holds(self, timeout: float) -> bool:
        """Try to connect, for at most ``timeout`` seconds; the connection is closed again at once."""
        try:
            with socket.create_connection((self.host, self.port), timeout):
                return True
        except OSError:
            return False

    def __str__(self) -> str:
        """Say what is missing."""
        return f"port {self.port} of {self.host} does not accept connections"


class FileProbe:
    """A path exists and has been made, or written to, since this probe was made."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._before = self._state()

    def holds(self, timeout: float) -> bool:
        """Look at it."""
        del timeout
        state = self._state()
        return state is not None and state != self._before

    def _state(self) -> tuple[int, int] | None:
        try:
            found = self._path.stat()
        except OSError:
            return None
        return found.st_ino, found.st_mtime_ns

    def __str__(self) -> str:
        """Say what is missing."""
        if self._before is not None:
            return f"{self._path} was there before, and has not been written to since"
        return f"{self._path} does not exist"


class CommandProbe:
    """A program, run without a shell, ends with exit status 0. What it writes is thrown away."""

    def __init__(self, words: Sequence[str], *, environ: Mapping[str, str], directory: str | None = None) -> None:
        self._words = [*words]
        self._environ = environ
        self._directory = directory
        self._last = "has not been run yet"

    def holds(self, timeout: float) -> bool:
        """Run it for at most ``timeout`` seconds; after that it is killed with its group, and the answer is no."""
        try:
            process = subprocess.Popen(
                self._words,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env=self._environ,
                cwd=self._directory,
                start_new_session=True,
                preexec_fn=processes.die_with_parent,  # noqa: PLW1509 - one system call that takes no lock
            )
        except OSError as error:
            self._last = f"cannot be started: {os.strerror(error.errno or 0)}"
            return False
        try:
            status = process.wait(timeout)
        except subprocess.TimeoutExpired:
            self._last = f"did not end within {timeout:g} s"
            return False
        finally:
            if process.returncode is None:
                processes.signal_group(process.pid, signal.SIGKILL)
                process.wait()
        self._last = f"ended with {_how(status)}"
        return status == 0

    def __str__(self) -> str:
        """Say what is missing."""
        return f"{' '.join(self._words)!r} {self._last}"


def _how(status: int) -> str:
    return processes.describe_end(status, processes.signal_name(-status) if status < 0 else "")
