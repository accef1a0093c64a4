"""Run a program under test: started without a shell, its output read while it runs, ended when the test is.

The program lives in the worker's process group, so that the runner's last resort reaches it; it dies with the worker.
"""

from __future__ import annotations

import errno
import glob
import os
import resource
import select
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rtf import clock
from rtf.testing.isolation import processes
from rtf.testing.verdict import TestProblem

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

#: Seconds a program has between SIGTERM and SIGKILL when its test is stopped; less than the runner gives the test.
GRACE = 1.0

#: Seconds between looks at signals, which ask for the end: one that comes just before the wait does not interrupt it.
_LOOKS = 0.25
_CHUNK = 64 * 1024
#: The largest pipe an unprivileged process can have: what may still be unread when the program has ended.
_PIPE = 1 << 20

_CORE_PATTERN = Path("/proc/sys/kernel/core_pattern")
_CORE_WITH_PID = Path("/proc/sys/kernel/core_uses_pid")


class LineCutter:
    """Cuts bytes into lines of text. A line longer than ``limit`` bytes loses its end; memory is bounded by it."""

    def __init__(self, limit: int = 64 * 1024) -> None:
        self._limit = limit
        self._begun = b""

    def feed(self, data: bytes) -> Iterator[str]:
        """Give the lines that ``data`` completes, without their ends."""
        *whole, rest = data.split(b"\n")
        for piece in whole:
            yield self._ended(piece)
        self._begun = (self._begun + rest)[: self._limit]

    def finish(self) -> Iterator[str]:
        """Give the last line, if it had no end."""
        if self._begun:
            yield self._ended(b"")

    def _ended(self, piece: bytes) -> str:
        line, self._begun = self._begun + piece, b""
        return line[: self._limit].decode("utf-8", errors="replace")


@dataclass(frozen=True, slots=True)
class Ended:
    """How a program ended: its exit status, or the name of the signal; ``no_core`` says why no core dump is kept."""

    status: int | None
    signal: str = ""
    no_core: str = ""

    def __str__(self) -> str:
        return processes.describe_end(self.status, self.signal)


def run_program(
    words: Sequence[str], environ: Mapping[str, str], take: Callable[[bytes], object], *, cores: Path | None = None
) -> Ended:
    """Run a program to its end and hand its output to ``take``.

    When this function raises, the program has ended: it gets SIGTERM, and SIGKILL a second later. A core dump is put
    into the folder ``cores``. A grandchild that holds the pipe open is not waited for. Raises TestProblem when the
    program cannot be started.
    """
    began = clock.now()
    program = _start(words, environ, _allow_core_dumps if cores else processes.die_with_parent)
    try:
        _follow(program, take, clock.Deadline())
    except BaseException:
        _end(program, take)
        raise
    finally:
        if program.stdout is not None:
            program.stdout.close()
    status = program.wait()
    if status >= 0:
        return Ended(status)
    return Ended(None, processes.signal_name(-status), keep_core_dump(program.pid, cores, began) if cores else "")


def _start(words: Sequence[str], environ: Mapping[str, str], before: Callable[[], None]) -> subprocess.Popen[bytes]:
    try:
        return subprocess.Popen(
            words,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            env=environ,
            bufsize=0,
            preexec_fn=before,  # noqa: PLW1509 - a worker has one thread when it starts the program
        )
    except OSError as error:
        why = why_not_started(words[0], error)
    except ValueError as error:  # a NUL character in an argument
        why = f"{words[0]}: {error}"
    raise TestProblem(why, title="the program cannot be started")


def why_not_started(file: str, error: OSError) -> str:
    """Return why a program cannot be started and how to fix it; the kernel only gives a number."""
    if error.errno == errno.EACCES and os.path.isfile(file) and not os.access(file, os.X_OK):  # noqa: PTH113
        return f"{file} is not executable; chmod +x {file} fixes that"
    if error.errno == errno.ENOEXEC:
        return f"{file} is neither a binary for this machine nor has it a first line such as #!/bin/sh"
    if error.errno in (errno.ENOENT, errno.EACCES) and os.path.isfile(file):  # noqa: PTH113
        interpreter = _interpreter(file)
        if interpreter.endswith("\r"):
            return f"{file} has Windows line ends, so its interpreter {interpreter!r} is not found; dos2unix fixes that"
        if interpreter:
            state = "cannot be run" if os.path.exists(interpreter) else "does not exist"  # noqa: PTH110
            return f"{file} names the interpreter {interpreter}, which {state}; fix its first line, or install it"
        if error.errno == errno.ENOENT:
            return f"{file} needs a program loader that this machine does not have; is it built for another system?"
    return f"{file}: {os.strerror(error.errno or 0)}"


def _interpreter(file: str) -> str:
    try:
        with open(file, "rb") as stream:  # noqa: PTH123 - one line of it
            line = stream.readline(256)
    except OSError:
        return ""
    if not line.startswith(b"#!"):
        return ""
    text = os.fsdecode(line[2:].rstrip(b"\n")).strip(" ")
    return text if text.endswith("\r") else text.split(" ")[0]


def _follow(program: subprocess.Popen[bytes], take: Callable[[bytes], object], deadline: clock.Deadline) -> None:
    """Read until the program has ended or the deadline has passed."""
    assert program.stdout is not None
    out, ended = program.stdout.fileno(), os.pidfd_open(program.pid)
    sources = [ended, out]
    try:
        while not deadline.expired:
            ready, _, _ = select.select(sources, [], [], min(deadline.remaining(), _LOOKS))
            if ended in ready:
                _drain(out, take)
                return
            if ready and not _read(out, take):
                sources.remove(out)
    finally:
        os.close(ended)


def _read(out: int, take: Callable[[bytes], object]) -> int:
    """Read once, and wait for it. Returns the number of bytes, 0 at the end."""
    data = os.read(out, _CHUNK)
    if data:
        take(data)
    return len(data)


def _drain(out: int, take: Callable[[bytes], object]) -> None:
    """Read what the ended program left in the pipe, and no more: a grandchild may write for ever."""
    left = _PIPE
    while left > 0 and select.select([out], [], [], 0)[0]:
        count = _read(out, take)
        left -= count or _PIPE


def _end(program: subprocess.Popen[bytes], take: Callable[[bytes], object]) -> None:
    try:
        if program.poll() is None:
            program.terminate()
            _follow(program, take, clock.Deadline.after(GRACE))
    finally:
        if program.poll() is None:
            program.kill()
        program.wait()


# Core dumps: kept on request, where the kernel writes files ---------------------------------------------------------


def _allow_core_dumps() -> None:
    """Let the program that this process becomes write core files."""
    processes.die_with_parent()
    _, most = resource.getrlimit(resource.RLIMIT_CORE)
    resource.setrlimit(resource.RLIMIT_CORE, (most, most))


def keep_core_dump(pid: int, folder: Path, since: float) -> str:
    """Move the core file of a program that crashed into a folder. Returns why there is none, or nothing.

    ``since`` is when the program was started, in seconds since 1970; an older file is of another one.
    """
    pattern = _CORE_PATTERN.read_text().strip()
    if pattern.startswith("|"):
        return (
            f"no core dump is kept: the kernel hands it to {pattern[1:].split()[0]}; "
            "`sysctl kernel.core_pattern=core.%p` has it write files"
        )
    if resource.getrlimit(resource.RLIMIT_CORE)[1] == 0:
        return "no core dump is kept: the limit of this machine is 0 (ulimit -Hc)"
    found = [path for path in _candidates(pattern, pid) if path.is_file() and path.stat().st_mtime >= since - 1.0]
    if not found:
        return f"the kernel has written no core dump as {pattern} in {Path.cwd()}"
    newest = max(found, key=lambda path: path.stat().st_mtime)
    folder.mkdir(parents=True, exist_ok=True)
    shutil.move(newest, folder / f"core.{pid}")
    return ""


def _candidates(pattern: str, pid: int) -> list[Path]:
    """Return the files that the pattern may mean; of its variables only the process is known for sure, see core(5)."""
    name, parts = "", iter(pattern)
    for character in parts:
        variable = next(parts, "") if character == "%" else ""
        name += {"%": "%", "p": str(pid)}.get(variable, "*") if variable else glob.escape(character)
    names = [name, f"{name}.{pid}"] if _CORE_WITH_PID.read_text().strip() != "0" else [name]
    return [Path(path) for one in names for path in glob.glob(one)]  # noqa: PTH207 - the pattern may be absolute
