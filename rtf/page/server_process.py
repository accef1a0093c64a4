"""The runner's side of the live page: it opens the port, starts the server process, and handles its requests.

The runner never waits for the server: browsers that connect before it is ready wait at the open port. The libraries of
the server are not imported here. A server that dies or sends invalid requests does not affect the run.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import os
import select
import signal
import socket
import struct
import sys
import threading
from typing import TYPE_CHECKING, Any

from rtf.testing.reporting import ReportError
from rtf.testing.run_control import AnswerError, TooLateError

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.page.settings import Settings
    from rtf.testing.run_control import Control

#: The file descriptors of the new process.
LISTENER_FD, CHANNEL_FD, POKE_FD = 3, 4, 5
_FIRST_DESCRIPTOR = 10
#: The longest line of the channel, in bytes; it can have an answer that a person typed.
MAX_LINE = 1 << 18
#: Limits in seconds: for the start of the server if a client waits for it, for the end of its connections, and for
#: sending a line.
_COME_UP = 10.0
_LEAVE = 3.0
_SEND_TIME = struct.pack("@ll", 1, 0)
_BACKLOG = 128
#: The nice value of the server, so that the run has priority; and its first statements, so that this also holds while
#: it imports its libraries. With autogroups of sessions the nice value of the group counts.
_NICE = 5
_START = """
import contextlib, os, sys
os.nice({nice})
with contextlib.suppress(OSError), open("/proc/self/autogroup", "w") as share:
    share.write("{nice}")
sys.path[:] = {path!r}
from rtf.page import server
server.main()
"""
#: The recorded origin of a stop request and of an answer.
STOPPED_BY, ANSWERED_BY = "the web page", "web"


def listen(host: str, port: int) -> socket.socket:
    """Open a port; 0 means any free one. Raises ReportError if that fails."""
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        listener = socket.socket(family, socket.SOCK_STREAM)
    except OSError as error:
        raise ReportError(
            f"the web page cannot be served at {host!r}: {error.strerror}; name an address of this machine"
        ) from None
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(_BACKLOG)
    except OSError as error:
        listener.close()
        if error.errno == errno.EADDRINUSE:
            text = f"port {port} is in use; choose another with --web-port, or any free one with --web-port 0"
        else:
            text = f"cannot listen on {host} port {port}: {error.strerror}; choose others with --web-host, --web-port"
        raise ReportError(text) from None
    return listener


class ServerProcess:
    """The server process of a run's page."""

    def __init__(self, settings: Settings, listener: socket.socket, log: Path, control: Control | None) -> None:
        self._listener = listener
        self._log = log
        self._control = control
        if control is not None:
            control.attend()
        self._poke = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._channel, there = socket.socketpair()
        self._channel.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, _SEND_TIME)
        self._ready = threading.Event()
        self._closing = False
        self._sending = threading.Lock()
        try:
            self.pid = _spawn([listener.fileno(), there.fileno(), self._poke], log)
        finally:
            there.close()
        self._send(settings.to_line())
        self._receiving = threading.Thread(target=self._receive, name="rtf-page", daemon=True)
        self._receiving.start()

    def notify(self) -> None:
        """Notify the server of new lines in the journal; takes a microsecond and never waits."""
        try:  # called for each event; suppress() would double the time
            os.eventfd_write(self._poke, 1)
        except BlockingIOError:
            return  # the counter is full

    @property
    def alive(self) -> bool:
        """Whether the server still has the channel open."""
        return self._receiving.is_alive()

    def wait(self, seconds: float) -> bool:
        """Wait for the server to end by itself; return whether it has."""
        self._receiving.join(seconds)
        return not self.alive

    def announce_end(self) -> None:
        """Tell the server that the journal is complete. It keeps running."""
        self._send(b'{"over": true}\n')

    def close(self) -> None:
        """End the server: at once without clients, otherwise as soon as all have received the rest."""
        self._closing = True
        if self._ready.is_set() or (self._has_waiting_clients() and self._ready.wait(_COME_UP)):
            with contextlib.suppress(OSError):
                self._channel.shutdown(socket.SHUT_WR)
            self.wait(_LEAVE)
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)  # it has ended, or hangs
        with contextlib.suppress(ChildProcessError):
            os.waitpid(self.pid, 0)
        self._receiving.join()
        self._channel.close()
        self._listener.close()
        os.close(self._poke)
        with contextlib.suppress(OSError):
            if self._log.stat().st_size == 0:
                self._log.unlink()

    def _has_waiting_clients(self) -> bool:
        return bool(select.select([self._listener], [], [], 0)[0])

    # The channel -------------------------------------------------------------------------------------------------

    def _send(self, line: bytes) -> None:
        with self._sending, contextlib.suppress(OSError):  # the receiving thread notices the end of the server
            self._channel.sendall(line)

    def _receive(self) -> None:
        with self._channel.makefile("rb") as lines, contextlib.suppress(OSError):
            while (line := lines.readline(MAX_LINE)).endswith(b"\n"):
                reply = self._handle(line)
                if reply is not None:
                    self._send(json.dumps(reply).encode() + b"\n")
        self._ready.set()  # nothing waits for it any more
        if not self._closing:
            sys.stderr.write(f"testrunner: the server of the web page has ended; the run continues. See {self._log}\n")

    def _handle(self, line: bytes) -> dict[str, Any] | None:
        """Handle a request line. An invalid one has no effect on the run."""
        try:
            record = json.loads(line)
            if "ready" in record:
                self._ready.set()
                return None
            return {"id": record["id"], **self._grant(record)}
        except (ValueError, KeyError, TypeError, RecursionError):
            return None

    def _grant(self, command: dict[str, Any]) -> dict[str, Any]:
        if self._control is None:
            return {"error": "this run accepts no requests", "late": True}
        try:
            if "stop" in command:
                self._control.stop(STOPPED_BY, int(command["stop"]))
            else:
                test, question, text = command["answer"]
                self._control.answer(test, question, text, ANSWERED_BY)
        except AnswerError as error:
            return {"error": str(error)}
        except TooLateError as error:
            return {"error": str(error), "late": True}
        return {}


def _spawn(descriptors: list[int], log: Path) -> int:
    """Start the server with these open files, in a session of its own, so that Ctrl-C does not reach it."""
    code = _START.format(nice=_NICE, path=sys.path)
    inherited = [fcntl.fcntl(descriptor, fcntl.F_DUPFD_CLOEXEC, _FIRST_DESCRIPTOR) for descriptor in descriptors]
    targets = (LISTENER_FD, CHANNEL_FD, POKE_FD)
    try:
        return os.posix_spawn(
            sys.executable,
            [sys.executable, "-P", "-c", code],
            os.environ,
            file_actions=[
                (os.POSIX_SPAWN_OPEN, 0, os.devnull, os.O_RDONLY, 0),
                (os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0),
                (os.POSIX_SPAWN_OPEN, 2, str(log), os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644),
                *((os.POSIX_SPAWN_DUP2, here, there) for here, there in zip(inherited, targets, strict=True)),
            ],
            setsid=True,
        )
    finally:
        for descriptor in inherited:
            os.close(descriptor)
