"""A connection to a machine by ssh: made when it is needed, and made again when it was lost.

Which user, address, keys and known hosts belong to the machine is read from ``~/.ssh/config``, as ssh does; keys of the
agent are used, too. A machine whose key is not among the known hosts is refused.
"""

from __future__ import annotations

import asyncio
import re
import secrets
import threading
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, TypeAlias, TypeVar

import asyncssh

from rtf import clock
from rtf.applications.errors import DeployerError
from rtf.applications.ssh.scripts import COMMAND

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine

#: Seconds for a connection, and for an answer of the other end.
_CONNECTING, _ANSWER = 10.0, 5.0
#: Seconds between two signs of life, and how many may be missing until the connection counts as lost.
_ALIVE, _MISSED = 2.0, 3
#: Seconds after a failure in which it is not tried again, as all who ask would try it.
_AGAIN = 2.0
#: The longest answer to a script, bytes: a process with a tag has some hundred.
_MOST = 1 << 22
_CHUNK = 1 << 16
_HOST = re.compile(r"[0-9A-Za-z_.:@%][0-9A-Za-z_.:@%-]*")

T = TypeVar("T")
Process: TypeAlias = "asyncssh.SSHClientProcess[bytes]"


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
        if word == "pid" and rest.isdigit():
            self.pid = int(rest)
            self.note_start()
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
        if word == "ended" and rest.isdigit():
            self.status = int(rest)
            self.note_end()


class SshConnection:
    """The connection to a host. Methods are called from any thread, and raise DeployerError."""

    def __init__(self, host: str) -> None:
        if not _HOST.fullmatch(host):
            raise DeployerError(f"{host!r} is not the name of a machine")
        self.host = host
        self._connection: asyncssh.SSHClientConnection | None = None
        self._connecting = asyncio.Lock()
        self._failure = ""
        self._failed = 0.0
        self._tasks: set[asyncio.Task[None]] = set()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name=f"rtf-ssh {host}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Close the connection. Programs at the other end run on."""
        if self._thread.is_alive():
            asyncio.run_coroutine_threadsafe(self._close(), self._loop).result()
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join()
            self._loop.close()

    async def _close(self) -> None:
        if self._connection is not None:
            self._connection.abort()
            await self._connection.wait_closed()
        for task in [*self._tasks]:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def run(self, script: Callable[[str], str]) -> bytes:
        """Run a script, which is made for a token, and return what it says."""
        return self._wait(self._run(script))

    def start(self, script: Callable[[str], str], program: RemoteProgram) -> str:
        """Run a script that starts a program. Return what it says first, empty if it ends without a word."""
        return self._wait(self._start(script, program))

    def _wait(self, coroutine: Coroutine[None, None, T]) -> T:
        if not self._thread.is_alive():
            coroutine.close()
            raise DeployerError(f"the connection to {self.host} was closed")
        try:
            return asyncio.run_coroutine_threadsafe(coroutine, self._loop).result()
        except TimeoutError:
            raise DeployerError(f"{self.host} did not answer by ssh in time") from None
        except asyncio.IncompleteReadError:
            raise DeployerError(f"{self.host} has no shell for programs: '{COMMAND}' said nothing there") from None
        except (asyncssh.Error, OSError) as error:
            if isinstance(error, DeployerError):
                raise
            raise DeployerError(f"the connection to {self.host} was lost: {_reason(error)}") from None

    # In the thread of the loop -----------------------------------------------------------------------------------

    async def _connected(self) -> asyncssh.SSHClientConnection:
        async with self._connecting:
            if self._connection is not None and not self._connection.is_closed():
                return self._connection
            if self._failure and clock.monotonic() - self._failed < _AGAIN:
                raise DeployerError(self._failure)
            try:
                self._connection = await self._connect()
            except DeployerError as error:
                self._failure, self._failed = str(error), clock.monotonic()
                raise
            return self._connection

    async def _connect(self) -> asyncssh.SSHClientConnection:
        try:
            options = asyncssh.SSHClientConnectionOptions(
                host=self.host,
                config=(),
                connect_timeout=_CONNECTING,
                login_timeout=_CONNECTING,
                keepalive_interval=_ALIVE,
                keepalive_count_max=_MISSED,
            )
            if options.known_hosts is None:
                raise DeployerError(
                    f"{self.host} is not connected, as its key would not be checked: name a file with known hosts in"
                    " place of 'UserKnownHostsFile none' in ~/.ssh/config"
                )
            return await asyncssh.connect(self.host, options=options)
        except asyncssh.HostKeyNotVerifiable as error:
            raise DeployerError(
                f"the key of {self.host} is not the one in known_hosts, or there is none ({_reason(error)}): compare"
                f" its fingerprint, and accept it once with 'ssh {self.host}'"
            ) from None
        except asyncssh.PermissionDenied as error:
            raise DeployerError(
                f"{self.host} does not let {options.username} in ({_reason(error)}): add a key to the agent with"
                " 'ssh-add', or name its IdentityFile in ~/.ssh/config"
            ) from None
        except TimeoutError:
            raise DeployerError(f"{self.host} cannot be reached by ssh: no answer in {_CONNECTING:g} s") from None
        except (asyncssh.Error, OSError, ValueError, asyncssh.ConfigParseError) as error:
            if isinstance(error, DeployerError):
                raise
            raise DeployerError(f"{self.host} cannot be reached by ssh: {_reason(error)}") from None

    async def _run(self, script: Callable[[str], str]) -> bytes:
        token, connection = secrets.token_hex(8), await self._connected()
        async with asyncio.timeout(_ANSWER):
            process = await _execute(connection, script(token))
            try:
                await _skip_to(process, token)
                answer = b""
                while data := await process.stdout.read(_CHUNK):
                    answer += data
                    if len(answer) > _MOST:
                        raise DeployerError(f"{self.host} answers with more than {_MOST} bytes")
                return answer
            finally:
                process.close()

    async def _start(self, script: Callable[[str], str], program: RemoteProgram) -> str:
        token, connection = secrets.token_hex(8), await self._connected()
        async with asyncio.timeout(_ANSWER):
            process = await _execute(connection, script(token))
            begun: asyncio.Future[str] = self._loop.create_future()
            task = self._loop.create_task(self._follow(process, token, program, begun))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)
            return await begun

    async def _follow(self, process: Process, token: str, program: RemoteProgram, begun: asyncio.Future[str]) -> None:
        try:
            await program.follow(process, token, begun)
        except (asyncssh.Error, asyncio.IncompleteReadError, OSError) as error:
            if not begun.done():
                begun.set_exception(error)
        finally:  # without a status it is found again when the connection is
            process.close()
            program.closed.set()
            program.note_end()


async def _execute(connection: asyncssh.SSHClientConnection, script: str) -> Process:
    process = await connection.create_process(COMMAND, encoding=None)
    process.stdin.write(script.encode("utf-8", "surrogateescape"))
    process.stdin.write_eof()
    return process


async def _skip_to(process: Process, token: str) -> None:
    """Skip what login files print. Raises IncompleteReadError if the script says nothing."""
    await process.stdout.readuntil(f"{token}\n".encode())


def _reason(error: Exception) -> str:
    """Return the reason of an error without its number."""
    return getattr(error, "reason", "") or getattr(error, "strerror", None) or str(error) or type(error).__name__
