"""The runner's side of the live page: it opens the port, starts the server's process, and obeys what comes from there.

The runner never waits for the server: browsers that come before it is up wait at the open port. Nothing of what the
server is made of is loaded here. A server that dies or talks nonsense does the run no harm.
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

from rtf.testing.operator import AnswerError
from rtf.testing.reporting import ReportError
from rtf.testing.run_control import TooLateError

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.page.settings import Settings
    from rtf.testing.run_control import Control

#: Where the new process finds its open files.
LISTENER_FD, CHANNEL_FD, POKE_FD = 3, 4, 5
_FIRST_DESCRIPTOR = 10
#: The longest line of the channel, in bytes; an answer that a person typed is in it.
MAX_LINE = 1 << 18
#: Seconds the server gets to come up, when somebody waits for it, and to take leave of its clients; and a line to go
#: through.
_COME_UP = 10.0
_LEAVE = 3.0
_SEND_TIME = struct.pack("@ll", 1, 0)
_BACKLOG = 128
#: How much the run is preferred to the server where processor time is short; and what the server does first of all,
#: so that it gives way while it loads its libraries, too. Where each session has a share of its own, the share counts.
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
#: By whom a run was stopped and a question answered, as the record says it.
STOPPED_BY, ANSWERED_BY = "the web page", "web"


def listen(host: str, port: int) -> socket.socket:
    """Open a port; 0 stands for any free one. Raises ReportError when that cannot be."""
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        listener = socket.socket(family, socket.SOCK_STREAM)
    except OSError as error:
        raise ReportError(
            f"the web page cannot be at {host!r}: {error.strerror}; name an address of this machine"
        ) from None
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(_BACKLOG)
    except OSError as error:
        listener.close()
        if error.errno == errno.EADDRINUSE:
            text = f"port {port} is in use; take another with --web-port, or --web-port 0 for any that is free"
        else:
            text = (
                f"{host} port {port} cannot be listened on: {error.strerror}; name another with --web-host, --web-port"
            )
        raise ReportError(text) from None
    return listener


class ServerProcess:
    """The server of one run's page."""

    def __init__(self, settings: Settings, listener: socket.socket, log: Path, control: Control | None) -> None:
        self._listener = listener
        self._log = log
        self._control = control
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
        self._hearing = threading.Thread(target=self._hear, name="rtf-page", daemon=True)
        self._hearing.start()

    def poke(self) -> None:
        """Say that there is something new in the journal; takes a microsecond and never waits."""
        try:  # each event passes here; suppress() would take as long again
            os.eventfd_write(self._poke, 1)
        except BlockingIOError:
            return  # nobody took notice 2 ** 64 times

    @property
    def alive(self) -> bool:
        """Whether the server still holds the channel."""
        return self._hearing.is_alive()

    def wait(self, seconds: float) -> bool:
        """Wait so long for the server to end by itself; says whether it has."""
        self._hearing.join(seconds)
        return not self.alive

    def say_over(self) -> None:
        """Tell the server that the journal is complete. It stays up."""
        self._send(b'{"over": true}\n')

    def close(self) -> None:
        """Have the server end: at once when nobody looks, else as soon as everybody has the rest."""
        self._closing = True
        if self._ready.is_set() or (self._somebody_waits() and self._ready.wait(_COME_UP)):
            with contextlib.suppress(OSError):
                self._channel.shutdown(socket.SHUT_WR)
            self.wait(_LEAVE)
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)  # it has ended, or is not going to
        with contextlib.suppress(ChildProcessError):
            os.waitpid(self.pid, 0)
        self._hearing.join()
        self._channel.close()
        self._listener.close()
        os.close(self._poke)
        with contextlib.suppress(OSError):
            if self._log.stat().st_size == 0:
                self._log.unlink()

    def _somebody_waits(self) -> bool:
        return bool(select.select([self._listener], [], [], 0)[0])

    # The channel -------------------------------------------------------------------------------------------------

    def _send(self, line: bytes) -> None:
        with self._sending, contextlib.suppress(OSError):  # that the server is gone is noticed where it is listened to
            self._channel.sendall(line)

    def _hear(self) -> None:
        with self._channel.makefile("rb") as lines, contextlib.suppress(OSError):
            while (line := lines.readline(MAX_LINE)).endswith(b"\n"):
                reply = self._obey(line)
                if reply is not None:
                    self._send(json.dumps(reply).encode() + b"\n")
        self._ready.set()  # nobody need wait for it any more
        if not self._closing:
            sys.stderr.write(f"testrunner: the web page is gone; the run goes on. {self._log} may say why\n")

    def _obey(self, line: bytes) -> dict[str, Any] | None:
        """Do what a line says. Whatever it is, it does not hurt the run."""
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
            return {"error": "this run takes no requests", "late": True}
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
    """Start the server with these open files, in a session of its own: no terminal's Ctrl-C reaches it."""
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
