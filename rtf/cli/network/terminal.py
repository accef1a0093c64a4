"""How a tool begins and ends, and its input and output: lines, signals, and errors.

Results go to stdout, one line at a time; prompts and progress only to a terminal. However a tool ends, its ports are
closed and their names unregistered, unless a second signal or SIGKILL ends it at once.
"""

from __future__ import annotations

import io
import logging
import os
import select
import signal
import sys
from contextlib import contextmanager, suppress
from itertools import islice
from typing import TYPE_CHECKING, NoReturn, Protocol, TypeVar

from rtf.bottle import Bottle, Dialect, is_complete
from rtf.errors import RtfError
from rtf.middleware.errors import NameNotFoundError
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from types import FrameType, TracebackType


class Closable(Protocol):
    """A port, or something else that has to be closed."""

    def close(self) -> None:
        """Close it. A second call has no effect."""


P = TypeVar("P", bound=Closable)
#: What is said of errors, connections and progress is logged, too; see :func:`rtf.logs.forward_if_enabled`.
_log = logging.getLogger("rtf")
_log.addHandler(logging.NullHandler())
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_SOON = 0.01  # s, until an interrupt is tried again


# The end ---------------------------------------------------------------------------------------------------------


class Ending:
    """Makes KeyboardInterrupt of the first signal that asks for the end, though not while it is held off.

    A signal that was ignored when the program started, as in the background of a script, stays ignored. To wait without
    an end use ``wait``: Python alone may miss a signal that comes just before a wait. In code whose exceptions Python
    ignores (see :func:`_is_ignored`) the interrupt would be lost; it is raised a moment later then.
    """

    def __init__(self) -> None:
        self._held = 0
        self._came = False
        self._before: dict[signal.Signals, object] = {}
        self._bell = (-1, -1)

    def wait(self, descriptor: int) -> None:
        """Wait until there is something to read. Raises KeyboardInterrupt."""
        poll = select.poll()
        poll.register(descriptor, select.POLLIN)
        poll.register(self._bell[0], select.POLLIN)
        while descriptor not in [ready for ready, _ in poll.poll()]:
            pass  # the handler runs now, and raises

    def hold(self) -> None:
        """Hold the interrupt off, while something is made or released that must be done whole."""
        self._held += 1

    def release(self) -> None:
        """Allow the interrupt; raises KeyboardInterrupt if it has come meanwhile."""
        self._held -= 1
        if self._came and not self._held:
            self._raise()

    def _on_signal(self, signum: int, frame: FrameType | None) -> None:
        for number in self._before:
            signal.signal(number, signal.SIG_DFL)
        self._came = True
        self._interrupt(signum, frame)

    def _interrupt(self, _signum: int, frame: FrameType | None) -> None:
        if not self._came or self._held:
            return
        if not _is_ignored(frame):
            self._raise()
        self._before.setdefault(signal.SIGALRM, signal.signal(signal.SIGALRM, self._interrupt))
        signal.setitimer(signal.ITIMER_REAL, _SOON)

    def _raise(self) -> NoReturn:
        self._came = False
        raise KeyboardInterrupt

    def __enter__(self) -> None:
        self._bell = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        signal.set_wakeup_fd(self._bell[1], warn_on_full_buffer=False)
        for number in _SIGNALS:
            if signal.getsignal(number) is not signal.SIG_IGN:
                self._before[number] = signal.signal(number, self._on_signal)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if signal.SIGALRM in self._before:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        while self._before:
            number, before = self._before.popitem()
            signal.signal(number, before)  # type: ignore[arg-type]  # it came from the same module
        signal.set_wakeup_fd(-1)
        for descriptor in self._bell:
            os.close(descriptor)


def _is_ignored(frame: FrameType | None) -> bool:
    """Return whether an exception would be printed and forgotten: in destructors, and in a callback of imports."""
    while frame is not None:
        code = frame.f_code
        if code.co_name == "__del__" or (code.co_name == "cb" and code.co_filename == "<frozen importlib._bootstrap>"):
            return True
        frame = frame.f_back
    return False


class Bell:
    """Wakes the main thread while other threads work: each ``ring`` lets one ``wait`` return."""

    def __init__(self) -> None:
        self._descriptor = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_SEMAPHORE)

    def ring(self) -> None:
        """Wake the main thread. From any thread."""
        os.eventfd_write(self._descriptor, 1)

    def wait(self) -> None:
        """Wait for a ring. Raises KeyboardInterrupt."""
        ENDING.wait(self._descriptor)
        os.eventfd_read(self._descriptor)

    def __del__(self) -> None:
        os.close(self._descriptor)  # ``ring`` holds it, too


ENDING = Ending()


@contextmanager
def opened(make: Callable[[], P]) -> Iterator[P]:
    """Open a port for the time of a block. It is opened whole and closed whole, whatever signals come."""
    ENDING.hold()
    try:
        port = make()
        try:
            ENDING.release()
            yield port
        finally:
            ENDING.hold()
            port.close()
    finally:
        ENDING.release()


def run_to_its_end(program: str, tool: Callable[[Sequence[str]], int], words: Sequence[str]) -> int:
    """Run a command of the network; returns its exit code."""
    for stream in (sys.stdin, sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # Bytes that are no UTF-8 come and go as they are, whatever the locale.
            stream.reconfigure(encoding="utf-8", errors="surrogateescape")
    try:
        with ENDING:
            code = tool(words)
    except KeyboardInterrupt:
        return ExitCode.INTERRUPTED
    except RtfError as error:
        complain(f"{program}: {error}", _KNOWN if isinstance(error, NameNotFoundError) else "")
        return ExitCode.FAILURES
    return code


_KNOWN = "'rtf list' shows what is registered"


# Speaking --------------------------------------------------------------------------------------------------------


def say(text: str) -> None:
    """Print a line of the result at once: a program may be waiting for it."""
    print(text, flush=True)


def complain(text: str, hint: str = "") -> None:
    """Print an error, marked as YARP marks it, and the hint on a line of its own."""
    _log.error(text)
    print(f"[ERROR] {text}", file=sys.stderr)
    if hint:
        print(f"        {hint}", file=sys.stderr)


def report(sentence: str) -> None:
    """Print what happened to a connection; for the network."""
    _log.warning(sentence)
    print(f"[WARNING] {sentence}", file=sys.stderr, flush=True)


def progress(text: str) -> None:
    """Print what the tool waits for, on a terminal only."""
    _log.info(text)
    if sys.stderr.isatty():
        print(text, file=sys.stderr, flush=True)


# Being spoken to -------------------------------------------------------------------------------------------------


def typed(prompt: str = "", words: Sequence[str] = ()) -> Iterator[str]:
    """Yield lines that are typed, or come from a file or program; they are joined while a list or quotes are open.

    On a terminal there is a prompt, lines can be edited and called back, and the tabulator completes ``words``.
    """
    text = ""
    for line in _edited(prompt, words) if sys.stdin.isatty() else _piped(sys.stdin.fileno()):
        text = f"{text}\n{line}" if text else line
        if is_complete(text):
            yield text
            text = ""
    if text:
        yield text


def typed_bottle(text: str) -> Bottle:
    """Read a typed bottle. A long vocab is whole for ports of YARP 4; to others its first four letters are sent."""
    return Bottle.parse(text, dialect=Dialect.YARP4)


def _edited(prompt: str, words: Sequence[str]) -> Iterator[str]:
    import readline  # gives input() a memory

    def completed(begun: str, number: int) -> str | None:
        return next(islice((word for word in words if word.startswith(begun)), number, None), None)

    if words:
        readline.set_completer(completed)
        readline.parse_and_bind("tab: complete")
    with suppress(EOFError):
        while True:
            yield input(prompt)


def _piped(descriptor: int) -> Iterator[str]:
    rest = b""
    while True:
        ENDING.wait(descriptor)
        data = os.read(descriptor, _CHUNK)
        *lines, rest = (rest + data).split(b"\n")
        if not data and rest:
            lines, rest = [rest], b""
        for line in lines:
            yield line.removesuffix(b"\r").decode("utf-8", "surrogateescape")
        if not data:
            return


_CHUNK = 1 << 16
