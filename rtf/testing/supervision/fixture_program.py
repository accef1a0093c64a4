"""A program that a fixture runs: started without a shell, read, its end noticed at once, and always ended.

For fixture plug-ins. The program's output goes into the journal, and its end is the collapse of the fixture. The
program is the leader of a session of its own, so that it and its children can be signalled together and no terminal
reaches it; it dies with the thread that started it, which therefore has to be the main thread of the fixture's process.
"""

from __future__ import annotations

import errno
import itertools
import os
import select
import shutil
import signal
import subprocess
import sys
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING

from rtf import clock
from rtf.testing.fixture import FixtureUnusable
from rtf.testing.isolation import processes
from rtf.testing.isolation.capture import Tail
from rtf.testing.languages.program import LineCutter, why_not_started
from rtf.testing.verdict import FixtureCollapsed

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from rtf.testing.fixture import FixtureManager

_CHUNK = 64 * 1024
#: The largest pipe an unprivileged process can have: what may still be unread when the program has ended.
_PIPE = 1 << 20
#: A line is cut after this many bytes.
_LINE_LIMIT = 8192
_VANISH = 5.0
#: The most of a last line that is shown.
_SHOWN = 300
#: Seconds between two looks at a program that is not ready.
_POLL = 0.05
_MARK = "RTF_PROGRAM"
#: The signals that stop a fixture.
_STOPS = frozenset({signal.SIGTERM, signal.SIGINT})

_numbers = itertools.count(1)


@dataclass(frozen=True, slots=True)
class ProgramEnd:
    """The end of a program: ``exit_status``, or the name of a signal; ``str`` gives ``killed by SIGSEGV``."""

    exit_status: int | None
    signal: str

    def __str__(self) -> str:
        return processes.describe_end(self.exit_status, self.signal)


def _beside_python(file: str, environ: Mapping[str, str]) -> str:
    """Return a program's file, which is beside Python's where an environment such as ``.venv`` is not active."""
    beside = Path(sys.executable).with_name(file) if file and "/" not in file else None
    if beside is None or shutil.which(file, path=environ.get("PATH")) or not beside.is_file():
        return file
    return str(beside)


class FixtureProgram:
    """One run of a program. ``name`` is that for people, such as *the simulator*; else the program's file name.

    ``variables`` are added to the environment of the run. ``heard`` is called in a thread of its own with whole lines,
    joined, without the last line end. An end that was not asked for with :meth:`stop` is reported as the fixture's
    collapse at once, after all output of the program was handed on.
    """

    def __init__(
        self,
        fixture: FixtureManager,
        words: Sequence[str],
        *,
        name: str = "",
        variables: Mapping[str, str] | None = None,
        directory: str | Path | None = None,
        heard: Callable[[str], object] = lambda _: None,
    ) -> None:
        self._environ = {**os.environ, "PYTHONUNBUFFERED": "1", **(variables or {})}
        self.words = (_beside_python(words[0], self._environ), *words[1:])
        self.name = name or Path(self.words[0]).name
        self.end: ProgramEnd | None = None
        self._fixture = fixture
        self._mark = f"{os.getpid()}-{next(_numbers)}"
        self._environ[_MARK] = self._mark
        self._directory = directory
        self._heard = heard
        self._tail = Tail()
        self._process: subprocess.Popen[bytes] | None = None
        self._streams: dict[IO[bytes], tuple[str, LineCutter]] = {}  # those that are open
        self._pidfd = -1
        self._thread = threading.Thread(target=self._attend, name=f"rtf-program-{self.name}", daemon=True)
        self._ended = threading.Event()
        self._stopping = False

    def start(self) -> None:
        """Start the program. Raises FixtureUnusable, with the program and a hint, when that is not possible."""
        parent = os.getpid()

        def tie() -> None:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            processes.die_with_parent()
            if os.getppid() != parent:  # it died in between
                os._exit(1)

        # No signal ends this half-way: a program that runs has a thread that attends it, so that it can be stopped.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, _STOPS)
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
                preexec_fn=tie,  # noqa: PLW1509 - it makes three system calls and takes no lock
            )
            self._pidfd = os.pidfd_open(self._process.pid)
            self._thread.start()
        except (OSError, ValueError) as error:
            raise FixtureUnusable(self._why_not(error)) from None
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def _why_not(self, error: OSError | ValueError) -> str:
        file = self.words[0]
        if isinstance(error, ValueError):  # a NUL character
            return f"{file}: {error}"
        if self._directory is not None and not Path(self._directory).is_dir():
            return f"the directory {self._directory}, in which {file} is to run, does not exist or is none"
        if "/" not in file and error.errno == errno.ENOENT:
            return f"there is no program {file!r} on PATH; install it, or write its path"
        if error.errno == errno.ENOENT and not (Path(self._directory or ".") / file).exists():
            return f"there is no program {file}; install it, or correct its path"
        return why_not_started(str(Path(self._directory or ".") / file), error)

    def await_ready(self, missing: Callable[[float], str], timeout: float) -> None:
        """Wait until ``missing``, which is given the seconds that are left, returns an empty text.

        Raises FixtureCollapsed when the program ends, or with what is missing after ``timeout`` seconds.
        """
        deadline = clock.Deadline.after(timeout)
        while True:
            what = missing(deadline.remaining())
            if self.wait(_POLL if what else 0.0):
                raise FixtureCollapsed(self._how_it_ended())
            if not what:
                return
            if deadline.expired:
                raise FixtureCollapsed(f"{self.name} was not ready after {timeout:g} s: {what}")

    def _how_it_ended(self) -> str:
        """Return how it ended; with an exit status of an error, the last line that it wrote, to stderr if there is one.

        Its streams are two pipes: which of them was written last is unknown.
        """
        text, status = f"{self.name} ended: {self.end}", self.end.exit_status if self.end is not None else None
        lines = [*self._tail.lines("stdout"), *self._tail.lines("stderr")] if status else []
        last = next((line.strip() for line in reversed(lines) if line.strip()), "")
        return f"{text}; its last line: {last[:_SHOWN]}" if last else text

    def wait(self, timeout: float) -> bool:
        """Wait at most ``timeout`` seconds for the program's end to be known. Any thread."""
        return self._ended.wait(timeout)

    def exited(self) -> bool:
        """Return whether the program has ended, even if that has not been reported yet."""
        return self._pidfd >= 0 and bool(select.select([self._pidfd], [], [], 0)[0])

    def has_ended(self, timeout: float, *, lost: BaseException | None = None) -> bool:
        """Return whether the program has ended; wait ``timeout`` seconds for the report of its end.

        ``lost`` is the error of a request to the program. A program that dies closes its connections before its end can
        be seen, so that is waited for, too; not after a TimeoutError, because a silent program may be alive.
        """
        if isinstance(lost, TimeoutError) or (lost is None and not self.exited()):
            return False
        return self.wait(timeout) or self.exited()

    def stop(self, signum: int, timeout: float) -> bool:
        """End the program and its children: ``signum`` to the group, after ``timeout`` seconds SIGKILL, with a warning.

        Returns whether the program ended without being killed. Safe in every state, and more than once.
        """
        process = self._process
        if process is None:
            return True
        self._stopping = True
        for number in (signum, signal.SIGCONT):
            processes.signal_group(process.pid, number)
        gently = self._ended.wait(timeout)
        processes.signal_group(process.pid, signal.SIGKILL)  # its children: until it is reaped the group is its own
        for pid in processes.descendants_of(os.getpid()):
            if processes.carries(pid, f"{_MARK}={self._mark}"):  # one that left the group
                processes.signal_process(pid, signal.SIGKILL)
        self._ended.wait(_VANISH)
        self._thread.join(_VANISH)
        if self.end is not None:
            process.wait()
            self._process = None
            os.close(self._pidfd)
            self._pidfd = -1
        if not gently:
            name = processes.signal_name(signum)
            self._fixture.warn(f"{self.name} did not end within {timeout:g} s of {name}; killed")
        return gently

    # The thread --------------------------------------------------------------------------------------------------

    def _attend(self) -> None:
        """Read the program's output until it has ended and its pipes are closed."""
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _STOPS)  # what listens to it may start programs, too
        assert self._process is not None
        for name, stream in (("stdout", self._process.stdout), ("stderr", self._process.stderr)):
            assert stream is not None
            os.set_blocking(stream.fileno(), False)
            self._streams[stream] = (name, LineCutter(_LINE_LIMIT))
        while self._streams or self.end is None:
            sources: list[IO[bytes] | int] = [*self._streams]
            ready, _, _ = select.select(sources if self.end is not None else [self._pidfd, *sources], [], [])
            if self._pidfd in ready:
                self._note_end()
            for stream in self._streams.keys() & ready:
                self._read(stream)

    def _read(self, stream: IO[bytes]) -> bool:
        """Read once. Returns False when there is nothing at the moment, or nothing more."""
        name, lines = self._streams[stream]
        try:
            data = os.read(stream.fileno(), _CHUNK)
        except BlockingIOError:
            return False
        self._tail.feed(name, data)
        if whole := [*(lines.feed(data) if data else lines.finish())]:
            text = "\n".join(whole)
            self._fixture.output(text, name)
            try:
                self._heard(text)
            except Exception as error:  # noqa: BLE001 - of the fixture's author; the program is attended all the same
                self._heard = lambda _: None
                self._fixture.collapsed(f"what listens to {self.name} raised {type(error).__name__}: {error}")
        if not data:
            del self._streams[stream]
            stream.close()
        return bool(data)

    def _note_end(self) -> None:
        """Read how the program ended, without reaping it: until then no other process can get its number."""
        for stream in [*self._streams]:
            for _ in range(_PIPE // _CHUNK):  # what it left in its pipe, and no more: a grandchild may write for ever
                if not self._read(stream):
                    break
        result = os.waitid(os.P_PIDFD, self._pidfd, os.WEXITED | os.WNOWAIT)
        status = result.si_status if result is not None else 0
        exited = result is not None and result.si_code == os.CLD_EXITED
        end = self.end = ProgramEnd(status if exited else None, "" if exited else processes.signal_name(status))
        try:
            if not self._stopping:
                self._fixture.collapsed(
                    self._how_it_ended(),
                    exit_status=end.exit_status,
                    signal_name=end.signal,
                    output=self._tail.text(),
                )
        finally:
            self._ended.set()
