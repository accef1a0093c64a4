"""A machine that is reached by ssh: scripts that it answers, and programs that run there."""

from __future__ import annotations

import asyncio
import secrets
import threading
from abc import ABC, abstractmethod
from concurrent.futures import CancelledError
from typing import TYPE_CHECKING, TypeVar

import asyncssh

from rtf.applications.errors import DeployerError
from rtf.applications.ssh.lines import SESSIONS, Lines, reason_of
from rtf.applications.ssh.scripts import COMMAND

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine

    from rtf.applications.ssh.lines import Line, Process

#: Seconds for an answer of the other end, and for the start of a program.
_ANSWER, _STARTING = 5.0, 10.0
#: The longest answer to a script, bytes: a process with a tag has some hundred.
_MOST = 1 << 22
_CHUNK = 1 << 16
_DIGITS = 10

T = TypeVar("T")


class RemoteProgram(ABC):
    """A program at the other end. Its output comes by a channel of its own; methods are called in another thread.

    ``pid`` is that of its leader. ``status`` is the exit status as the shell has it: None as long as it is not known,
    and for ever if the connection was lost before. ``closed`` is set when no output comes any more.
    """

    def __init__(self) -> None:
        self.pid = 0
        self.status: int | None = None
        self.closed = threading.Event()

    @abstractmethod
    def note_start(self) -> None:
        """Take note that it runs; its output follows."""

    @abstractmethod
    def feed(self, data: bytes) -> None:
        """Take output. Must not wait."""

    @abstractmethod
    def note_end(self) -> None:
        """Take note that it has ended, or that no output comes any more."""

    async def follow(self, process: Process, token: str, begun: asyncio.Future[str]) -> None:
        """Take what comes until the channel ends. ``begun`` gets what the script says first."""
        first = await self._read_note(process, token)
        word, _, rest = first.partition(" ")
        if word == "pid" and _is_number(rest):
            self.pid = int(rest)
            self.note_start()
        if not begun.done():  # nobody waits for it any more
            begun.set_result(first)
        await asyncio.gather(self._take_output(process, token), self._take_status(process, token))

    async def _read_note(self, process: Process, token: str) -> str:
        """Return the next note of the script; empty if none follows."""
        while line := await process.stderr.readline():
            note = line.decode("utf-8", "replace").rstrip("\n").partition(f"{token} ")[2]
            if note:
                return note
        return ""

    async def _take_output(self, process: Process, token: str) -> None:
        await _skip_to(process, token)
        while data := await process.stdout.read(_CHUNK):
            self.feed(data)

    async def _take_status(self, process: Process, token: str) -> None:
        word, _, rest = (await self._read_note(process, token)).partition(" ")
        if word == "ended" and _is_number(rest):
            self.status = int(rest)
            self.note_end()


class _Shell:
    """A shell at the other end that answers one script after the other.

    It has a connection of its own, as answers would wait behind the output of programs. It is kept, as to begin one may
    take long: the server has the user's own shell begin it, which reads its files first.
    """

    def __init__(self, host: str) -> None:
        self._host = host
        self._lines = Lines(host)
        self._asking = asyncio.Lock()
        self._process: Process | None = None

    async def run(self, script: Callable[[str], str]) -> bytes:
        """Return what a script says, which is made for a token. Raises DeployerError, asyncssh.Error and others."""
        async with self._asking:
            token, done = secrets.token_hex(8), False
            try:
                process = await self._opened()
                process.stdin.write(
                    f"({script(token)}) </dev/null\necho {token} end\n".encode("utf-8", "surrogateescape")
                )
                async with asyncio.timeout(_ANSWER):
                    await _skip_to(process, token)
                    answer = await self._read(process, f"{token} end\n".encode())
                done = True
                return answer
            finally:
                if not done:  # what is still to come is no answer to the next script
                    self._end()

    async def _opened(self) -> Process:
        if self._process is None or self._process.is_closing():
            self._end()
            line = await self._lines.reserve()
            async with line, asyncio.timeout(_STARTING):
                self._process = await line.execute()
        return self._process

    async def _read(self, process: Process, end: bytes) -> bytes:
        answer = bytearray()
        while not answer.endswith(end):
            data = await process.stdout.read(_CHUNK)
            answer += data
            if not data or len(answer) > _MOST:
                raise DeployerError(f"{self._host} gives no answer, or one of more than {_MOST} bytes")
        return bytes(answer[: -len(end)])

    def _end(self) -> None:
        if self._process is not None:
            self._process.close()
            self._process = None

    async def close(self) -> None:
        """Close the connection."""
        self._end()
        await self._lines.close()


class SshConnection:
    """The connection to a host. Methods are called from any thread, and raise DeployerError."""

    def __init__(self, host: str) -> None:
        self.host = host
        self._shell, self._running = _Shell(host), Lines(host)
        self._tasks: set[asyncio.Task[None]] = set()
        self._lock = threading.Lock()  # of what follows
        self._closed = False
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name=f"rtf-ssh {host}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Close the connection. Programs at the other end run on; requests that wait for an answer fail."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
        asyncio.run_coroutine_threadsafe(self._close(), self._loop).result()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    async def _close(self) -> None:
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)
        await self._shell.close()
        await self._running.close()

    def run(self, script: Callable[[str], str]) -> bytes:
        """Run a script, which is made for a token, and return what it says."""
        return self._wait(self._shell.run(script))

    def start(self, script: Callable[[str], str], program: RemoteProgram) -> str:
        """Run a script that starts a program. Return what it says first, empty if it ends without a word."""
        return self._wait(self._start(script, program))

    def _wait(self, coroutine: Coroutine[None, None, T]) -> T:
        with self._lock:
            if self._closed:
                coroutine.close()
                raise DeployerError(f"the connection to {self.host} was closed")
            future = asyncio.run_coroutine_threadsafe(coroutine, self._loop)
        try:
            return future.result()
        except CancelledError:
            raise DeployerError(f"the connection to {self.host} was closed") from None
        except TimeoutError:
            raise DeployerError(f"{self.host} did not answer by ssh in time") from None
        except asyncio.IncompleteReadError:
            raise DeployerError(f"{self.host} has no shell for programs: '{COMMAND}' said nothing there") from None
        except asyncssh.ChannelOpenError as error:
            few = f"its sshd_config may allow fewer than {SESSIONS} for a connection (MaxSessions)"
            raise DeployerError(f"{self.host} begins no session ({reason_of(error)}): {few}") from None
        except (asyncssh.Error, OSError) as error:
            if isinstance(error, DeployerError):
                raise
            raise DeployerError(f"the connection to {self.host} was lost: {reason_of(error)}") from None

    # In the thread of the loop -----------------------------------------------------------------------------------

    async def _start(self, script: Callable[[str], str], program: RemoteProgram) -> str:
        token, line = secrets.token_hex(8), await self._running.reserve()
        begun: asyncio.Future[str] = self._loop.create_future()
        task = self._loop.create_task(self._follow(line, script(token), token, program, begun))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        async with asyncio.timeout(_STARTING):
            return await begun

    async def _follow(
        self, line: Line, script: str, token: str, program: RemoteProgram, begun: asyncio.Future[str]
    ) -> None:
        try:
            async with line:
                process = await line.execute()
                process.stdin.write(script.encode("utf-8", "surrogateescape"))
                process.stdin.write_eof()
                try:
                    await program.follow(process, token, begun)
                finally:
                    process.close()
        except (asyncssh.Error, asyncio.IncompleteReadError, OSError) as error:
            if not begun.done():
                begun.set_exception(error)
        finally:  # without a status it is found again when the connection is
            program.closed.set()
            program.note_end()


def _is_number(text: str) -> bool:
    return text.isascii() and text.isdigit() and len(text) <= _DIGITS


async def _skip_to(process: Process, token: str) -> None:
    """Skip what login files print. Raises IncompleteReadError if the script says nothing."""
    await process.stdout.readuntil(f"{token}\n".encode())
