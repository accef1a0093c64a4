"""Run a program under test: started without a shell, its output read while it runs, ended when the test is.

The program lives in the worker's process group, so that the runner's last resort reaches it; it dies with the worker.
"""

from __future__ import annotations

import errno
import os
import select
import subprocess
from typing import TYPE_CHECKING

from rtf import clock
from rtf.testing.isolation import processes
from rtf.testing.outcome import TestProblem

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

#: Seconds a program has between SIGTERM and SIGKILL when its test is stopped; less than the runner gives the test.
GRACE = 1.0

_CHUNK = 64 * 1024
#: The largest pipe an unprivileged process can have: what may still be unread when the program has ended.
_PIPE = 1 << 20


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


def run_program(
    words: Sequence[str],
    environ: Mapping[str, str],
    take: Callable[[bytes], object],
    *,
    before: Callable[[], None] = processes.die_with_parent,
    crashed: Callable[[int], object] = lambda _: None,
) -> tuple[int | None, str]:
    """Run a program to its end and hand what it writes to ``take``. Returns its exit status, or the signal's name.

    Whatever leaves this function by exception, the program has ended before: it gets SIGTERM, and SIGKILL a second
    later. ``before`` is called in its process before it is the program, ``crashed`` with its number after a signal
    ended it. A grandchild that holds the pipe open is not waited for. Raises TestProblem when it cannot be started.
    """
    program = _start(words, environ, before)
    try:
        _follow(program, take, clock.Deadline.after(None))
    except BaseException:
        _end(program, take)
        raise
    finally:
        if program.stdout is not None:
            program.stdout.close()
    status = program.wait()
    if status < 0:
        crashed(program.pid)
    return (None, processes.signal_name(-status)) if status < 0 else (status, "")


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
        raise TestProblem(why_not_started(words[0], error), title="the program cannot be started") from None
    except ValueError as error:  # a NUL character in an argument
        raise TestProblem(f"{words[0]}: {error}", title="the program cannot be started") from None


def why_not_started(file: str, error: OSError) -> str:
    """Say what is wrong with a program and how it is fixed, where the kernel only gives a number."""
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
    out = program.stdout.fileno()
    os.set_blocking(out, False)
    ended = os.pidfd_open(program.pid)
    try:
        poll = select.poll()
        poll.register(out, select.POLLIN)
        poll.register(ended, select.POLLIN)
        while not deadline.expired:
            ready = {descriptor for descriptor, _ in poll.poll(_milliseconds(deadline))}
            if ended in ready:
                _drain(out, take)
                return
            if out in ready and _read(out, take) == 0:
                poll.unregister(out)
    finally:
        os.close(ended)


def _milliseconds(deadline: clock.Deadline) -> int | None:
    left = deadline.remaining()
    return None if left == clock.FOREVER else int(left * 1000) + 1


def _read(out: int, take: Callable[[bytes], object]) -> int | None:
    """Read once. Returns the number of bytes, 0 at the end, None when there is nothing now."""
    try:
        data = os.read(out, _CHUNK)
    except BlockingIOError:
        return None
    if data:
        take(data)
    return len(data)


def _drain(out: int, take: Callable[[bytes], object]) -> None:
    """Read what the ended program left in the pipe, and no more: a grandchild may write for ever."""
    left = _PIPE
    while left > 0:
        count = _read(out, take)
        if not count:
            return
        left -= count


def _end(program: subprocess.Popen[bytes], take: Callable[[bytes], object]) -> None:
    try:
        if program.poll() is None:
            program.terminate()
            _follow(program, take, clock.Deadline.after(GRACE))
    finally:
        if program.poll() is None:
            program.kill()
        program.wait()
