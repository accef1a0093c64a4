"""The connections to a host: made when they are needed, and made again when they were lost.

Which user, address, keys and known hosts belong to a host is read from ``~/.ssh/config``, as ssh does; keys of the
agent are used, too. A host whose key is not among the known hosts is refused.
"""

from __future__ import annotations

import asyncio
import re
from typing import TYPE_CHECKING, Self, TypeAlias

import asyncssh

from rtf import clock
from rtf.applications.errors import DeployerError
from rtf.applications.ssh.scripts import COMMAND

if TYPE_CHECKING:
    from types import TracebackType

Process: TypeAlias = "asyncssh.SSHClientProcess[bytes]"

#: Seconds for a connection.
_CONNECTING = 10.0
#: Seconds between two signs of life, and how many may be missing until the connection counts as lost.
_ALIVE, _MISSED = 2.0, 3
#: Seconds after a failure in which it is not tried again, as all who ask would try it.
_AGAIN = 2.0
#: Sessions of a connection. The server of OpenSSH allows ten, unless its MaxSessions is another number.
SESSIONS = 8
_HOST = re.compile(r"[0-9A-Za-z_.:%][0-9A-Za-z_.:%-]*")


class Line:
    """A connection with room for a session, which is reserved until the end of an ``async with``."""

    def __init__(self, connection: asyncssh.SSHClientConnection) -> None:
        self.connection = connection
        self.used = 0

    @property
    def has_room(self) -> bool:
        """Whether one more session can be opened."""
        return self.used < SESSIONS and not self.connection.is_closed()

    async def execute(self) -> Process:
        """Begin a shell at the other end, which reads scripts from its standard input. Raises asyncssh.Error."""
        return await self.connection.create_process(COMMAND, encoding=None)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.used -= 1


class Lines:
    """As many connections to a host as its sessions need. Used in the thread of one event loop."""

    def __init__(self, host: str) -> None:
        if not _HOST.fullmatch(host):
            raise DeployerError(f"{host!r} is not the name of a machine; its user is in ~/.ssh/config")
        self._host = host
        self._lines: list[Line] = []
        self._connecting = asyncio.Lock()
        self._failure = ""
        self._failed = 0.0

    async def reserve(self) -> Line:
        """Return a connection on which a session is reserved. Raises DeployerError."""
        async with self._connecting:
            self._lines = [one for one in self._lines if not one.connection.is_closed()]
            line = next((one for one in self._lines if one.has_room), None)
            if line is None:
                line = Line(await self._connected())
                self._lines.append(line)
            line.used += 1
            return line

    async def _connected(self) -> asyncssh.SSHClientConnection:
        if self._failure and clock.monotonic() - self._failed < _AGAIN:
            raise DeployerError(self._failure)
        try:
            return await _connect(self._host)
        except DeployerError as error:
            self._failure, self._failed = str(error), clock.monotonic()
            raise

    async def close(self) -> None:
        """Close all connections."""
        for line in self._lines:
            line.connection.abort()
            await line.connection.wait_closed()


async def _connect(host: str) -> asyncssh.SSHClientConnection:
    try:
        options = asyncssh.SSHClientConnectionOptions(
            host=host,
            config=(),
            connect_timeout=_CONNECTING,
            login_timeout=_CONNECTING,
            keepalive_interval=_ALIVE,
            keepalive_count_max=_MISSED,
        )
        if options.known_hosts is None:
            raise DeployerError(
                f"{host} is not connected, as its key would not be checked: name a file with known hosts in"
                " place of 'UserKnownHostsFile none' in ~/.ssh/config"
            )
        return await asyncssh.connect(host, options=options)
    except asyncssh.HostKeyNotVerifiable as error:
        raise DeployerError(
            f"the key of {host} is not the one in known_hosts, or there is none ({reason_of(error)}): compare"
            f" its fingerprint, and accept it once with 'ssh {host}'"
        ) from None
    except asyncssh.PermissionDenied as error:
        raise DeployerError(
            f"{host} does not let {options.username} in ({reason_of(error)}): add a key to the agent with"
            " 'ssh-add', or name its IdentityFile in ~/.ssh/config"
        ) from None
    except TimeoutError:
        raise DeployerError(f"{host} cannot be reached by ssh: no answer in {_CONNECTING:g} s") from None
    except (asyncssh.Error, OSError, ValueError, asyncssh.ConfigParseError) as error:
        if isinstance(error, DeployerError):
            raise
        raise DeployerError(f"{host} cannot be reached by ssh: {reason_of(error)}") from None


def reason_of(error: Exception) -> str:
    """Return the reason of an error without its number."""
    return getattr(error, "reason", "") or getattr(error, "strerror", None) or str(error) or type(error).__name__
