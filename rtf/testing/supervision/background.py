"""A program that runs beside a fixture: started without a shell, heard, its end noticed at once, and always ended.

For fixture plug-ins, with the questions by which they find out whether a program is ready: a port, a file, a command.
It is the leader of a session of its own, so that it and what it starts can be signalled together and no terminal
reaches it; it dies with the thread that started it, which therefore has to be the main thread of the host.
"""

from __future__ import annotations

import contextlib
import errno
import itertools
import os
import select
import signal
import socket
import subprocess
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING

from rtf.testing.fixture import FixtureUnusable
from rtf.testing.isolation import processes
from rtf.testing.isolation.capture import Tail
from rtf.testing.languages.program import LineCutter, why_not_started

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

_CHUNK = 64 * 1024
#: The largest pipe an unprivileged process can have: what may still be unread when the program has ended.
_PIPE = 1 << 20
#: A line is cut after this many bytes.
_LINE_LIMIT = 8192
_VANISH = 5.0
_MARK = "RTF_PROGRAM"
_LARGEST_PORT = 65535

_numbers = itertools.count(1)


@dataclass(frozen=True, slots=True)
class ProgramEnd:
    """How a program ended: ``exit_status``, or the name of a signal; and the last lines it wrote."""

    exit_status: int | None
    signal: str
    output: str

    def __str__(self) -> str:
        """Say it, such as ``killed by SIGSEGV``."""
        return processes.describe_end(self.exit_status, self.signal)


class BackgroundProgram:
    """One run of a program. ``on_output(stream, text)`` and ``on_end(end)`` are called in a thread of its own.

    ``on_output`` gets whole lines, joined, without the last line end. ``on_end`` is called once, at the moment the
    program ends, whether that was asked for or not; what it writes has been handed on before.
    """

    def __init__(
        self,
        words: Sequence[str],
        *,
        environ: Mapping[str, str],
        directory: str | Path | None = None,
        on_output: Callable[[str, str], object],
        on_end: Callable[[ProgramEnd], object],
    ) -> None:
        self.words = tuple(words)
        self._mark = f"{os.getpid()}-{next(_numbers)}"
        self._environ = {**environ, _MARK: self._mark}
        self._directory = directory
        self._on_output = on_output
        self._on_end = on_end
        self._tail = Tail()
        self._process: subprocess.Popen[bytes] | None = None
        self._pidfd = -1
        self._thread: threading.Thread | None = None
        self._ended = threading.Event()
        self._end: ProgramEnd | None = None

    @property
    def name(self) -> str:
        """The program's name for people."""
        return Path(self.words[0]).name

    @property
    def end(self) -> ProgramEnd | None:
        """How it ended, once it has."""
        return self._end

    def start(self) -> None:
        """Start it. Raises FixtureUnusable, which names the program and the hint, when that is not possible."""
        parent = os.getpid()

        def tie() -> None:
            processes.die_with_parent()
            if os.getppid() != parent:  # it died in between
                os._exit(1)

        try:
            self._process = subprocess.Popen(
                self.words,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                bufsize=0,
                env=self._environ,
                cwd=self._directory,
                start_new_session=True,
                preexec_fn=tie,  # noqa: PLW1509 - it makes two system calls and takes no lock
            )
        except (OSError, ValueError) as error:
            raise FixtureUnusable(self._why_not(error)) from None
        self._pidfd = os.pidfd_open(self._process.pid)
        self._thread = threading.Thread(target=self._attend, name=f"rtf-program-{self.name}", daemon=True)
        self._thread.start()

    def _why_not(self, error: OSError | ValueError) -> str:
        file = self.words[0]
        if isinstance(error, ValueError):  # a NUL character
            return f"{file}: {error}"
        if self._directory is not None and not Path(self._directory).is_dir():
            return f"the directory {self._directory}, in which {file} is to run, does not exist or is none"
        if "/" not in file and error.errno == errno.ENOENT:
            return f"there is no program {file!r} on PATH; install it, or write its path"
        if error.errno == errno.ENOENT and not (Path(self._directory or ".") / file).exists():
            return f"there is no program {file}; install it, or hint its path"
        return why_not_started(str(Path(self._directory or ".") / file), error)

    def wait(self, timeout: float) -> bool:
        """Wait at most ``timeout`` seconds for its end to be known. Any thread."""
        return self._ended.wait(timeout)

    def exited(self) -> bool:
        """Whether it has ended, even if ``on_end`` has not been called yet."""
        return self._pidfd >= 0 and bool(select.select([self._pidfd], [], [], 0)[0])

    def has_ended(self, timeout: float, *, lost: BaseException | None = None) -> bool:
        """Whether it has ended; then ``on_end`` has been called, for which ``timeout`` seconds are waited.

        ``lost`` is what went wrong when it was asked something. What dies drops its connections before its end can be
        seen, so that is waited for, too; not after a TimeoutError, for who is silent may live.
        """
        if isinstance(lost, TimeoutError) or (lost is None and not self.exited()):
            return False
        return self.wait(timeout) or self.exited()

    def stop(self, signum: int, timeout: float) -> bool:
        """End it and everything it started: ``signum`` to the group, after ``timeout`` seconds SIGKILL.

        Returns whether it ended without being killed. Safe in every state, and more than once.
        """
        process = self._process
        if process is None:
            return True
        self._signal(process.pid, signum)
        self._signal(process.pid, signal.SIGCONT)
        gently = self._ended.wait(timeout)
        self._signal(
            process.pid, signal.SIGKILL
        )  # its children too; it is not reaped yet, so the group is still its own
        for pid in processes.descendants_of(os.getpid()):
            if processes.carries(pid, f"{_MARK}={self._mark}"):  # one that left the group
                processes.signal_process(pid, signal.SIGKILL)
        self._ended.wait(_VANISH)
        if self._thread is not None:
            self._thread.join(_VANISH)
        if self._end is not None:
            process.wait()
            self._process = None
            os.close(self._pidfd)
            self._pidfd = -1
        return gently

    @staticmethod
    def _signal(pid: int, signum: int) -> None:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(pid, signum)

    # The thread --------------------------------------------------------------------------------------------------

    def _attend(self) -> None:
        """Read what it writes until it has ended and nobody holds its pipes any more."""
        process = self._process
        assert process is not None
        assert process.stdout is not None
        assert process.stderr is not None
        streams = {file.fileno(): _Reader(name, file) for name, file in _named(process.stdout, process.stderr)}
        poll = select.poll()
        poll.register(self._pidfd, select.POLLIN)
        for descriptor in streams:
            os.set_blocking(descriptor, False)
            poll.register(descriptor, select.POLLIN)
        while streams or self._end is None:
            ready = [descriptor for descriptor, _ in poll.poll()]
            for descriptor in ready:
                if descriptor in streams and not self._read(streams[descriptor]):
                    poll.unregister(descriptor)
                    streams.pop(descriptor).file.close()
            if self._end is None and self._pidfd in ready:
                poll.unregister(self._pidfd)
                for reader in streams.values():
                    self._drain(reader)
                self._note_end()

    def _read(self, reader: _Reader) -> bool:
        """Read once. False at the end."""
        try:
            data = os.read(reader.file.fileno(), _CHUNK)
        except BlockingIOError:
            return True
        self._tail.feed(reader.name, data)
        lines = [*(reader.lines.feed(data) if data else reader.lines.finish())]
        if lines:
            self._on_output(reader.name, "\n".join(lines))
        return bool(data)

    def _drain(self, reader: _Reader) -> None:
        """Read what it left in the pipe, and no more: a grandchild may write for ever."""
        for _ in range(_PIPE // _CHUNK):
            if not select.select([reader.file], [], [], 0)[0]:
                return
            if not self._read(reader):
                return

    def _note_end(self) -> None:
        """Look how it ended, without reaping it: until that is done nobody else can get its number."""
        result = os.waitid(os.P_PIDFD, self._pidfd, os.WEXITED | os.WNOWAIT)
        exited = result is not None and result.si_code == os.CLD_EXITED
        status = result.si_status if result is not None else 0
        self._end = ProgramEnd(
            status if exited else None, "" if exited else processes.signal_name(status), self._tail.text()
        )
        try:
            self._on_end(self._end)
        finally:
            self._ended.set()


class _Reader:
    """One of its two streams."""

    def __init__(self, name: str, file: IO[bytes]) -> None:
        self.name = name
        self.file = file
        self.lines = LineCutter(_LINE_LIMIT)


def _named(stdout: IO[bytes], stderr: IO[bytes]) -> list[tuple[str, IO[bytes]]]:
    return [("stdout", stdout), ("stderr", stderr)]


# Questions to a program: each answers yes or no in a bounded time; str() says what is missing -------------------------


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
        self._last = (
            f"ended with {processes.describe_end(status, processes.signal_name(-status) if status < 0 else '')}"
        )
        return status == 0

    def __str__(self) -> str:
        """Say what is missing."""
        return f"{' '.join(self._words)!r} {self._last}"
