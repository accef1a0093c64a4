"""A real ssh server for tests, on loopback, with keys of its own, and an ``~/.ssh`` that knows it.

Commands are run by ``sh`` in sessions of their own, as sshd does. What they start is not ended with the connection.
"""

from __future__ import annotations

import asyncio
import contextlib
import subprocess
import threading
from pathlib import Path
from typing import IO, TYPE_CHECKING, TypeVar

import asyncssh

if TYPE_CHECKING:
    from collections.abc import Coroutine

T = TypeVar("T")


class SshServer:
    """A server that lets in who has the key in ``home/.ssh``, where the files of a user are: configuration and keys."""

    def __init__(self, home: Path) -> None:
        self.files = home / ".ssh"
        self.files.mkdir(mode=0o700)
        self._host_key, user_key = (asyncssh.generate_private_key("ssh-ed25519") for _ in range(2))
        user_key.write_private_key(self.files / "id_ed25519")
        (self.files / "id_ed25519").chmod(0o600)
        user_key.write_public_key(self.files / "authorized_keys")
        self._connections: list[asyncssh.SSHServerConnection] = []
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="ssh-server")
        self._thread.start()
        self.port = 0
        self._acceptor: asyncssh.SSHAcceptor | None = None
        self.open()
        self.write_config()
        self.write_known_hosts()

    def write_config(self, known_hosts: str = "") -> None:
        """Write the client's configuration: the machine ``pc104`` is this server."""
        (self.files / "config").write_text(
            f"Host pc104\n  HostName 127.0.0.1\n  Port {self.port}\n  IdentityFile {self.files}/id_ed25519\n"
            f"  UserKnownHostsFile {known_hosts or self.files / 'known_hosts'}\n"
        )

    def write_known_hosts(self, key: asyncssh.SSHKey | None = None) -> None:
        """Write the server's key, or another one, to the known hosts."""
        public = (key or self._host_key).export_public_key().decode()
        (self.files / "known_hosts").write_text(f"[127.0.0.1]:{self.port} {public}")

    @property
    def connections(self) -> int:
        """The number of connections that have had a session since the last cut."""
        return len(self._connections)

    def open(self) -> None:
        """Listen, at the same port if it was open before."""
        self._acceptor = self._wait(self._listen())
        self.port = self._acceptor.get_port()

    async def _listen(self) -> asyncssh.SSHAcceptor:
        return await asyncssh.listen(
            "127.0.0.1",
            self.port,
            server_host_keys=[self._host_key],
            authorized_client_keys=str(self.files / "authorized_keys"),
            process_factory=self._serve,
            encoding=None,
            reuse_address=True,
        )

    def cut(self) -> None:
        """Stop to listen, and cut all connections."""
        self._loop.call_soon_threadsafe(self._cut)
        self._wait(asyncio.sleep(0))

    def _cut(self) -> None:
        self._acceptor.close()
        for connection in self._connections:
            connection.abort()
        self._connections.clear()

    def close(self) -> None:
        """End the server."""
        self.cut()
        self._wait(self._acceptor.wait_closed())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    def _wait(self, work: Coroutine[None, None, T]) -> T:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(10.0)

    async def _serve(self, process: asyncssh.SSHServerProcess) -> None:
        connection = process.channel.get_connection()
        if connection not in self._connections:
            self._connections.append(connection)
        child = subprocess.Popen(  # noqa: ASYNC220 - takes no time
            ["sh", "-c", process.command],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
        feeding = asyncio.get_running_loop().create_task(_feed(process.stdin, child.stdin))
        with contextlib.suppress(asyncssh.Error, OSError):
            await asyncio.gather(_pump(child.stdout, process.stdout), _pump(child.stderr, process.stderr))
            process.exit(child.wait())
        feeding.cancel()
        threading.Thread(target=child.wait, daemon=True).start()  # reaps it when the connection is gone


async def _feed(reader: asyncssh.SSHReader, pipe: IO[bytes]) -> None:
    """Give a program what comes for it, until its end."""
    with contextlib.suppress(asyncssh.Error, OSError), pipe:
        while data := await reader.read(1 << 16):
            pipe.write(data)
            pipe.flush()


async def _pump(pipe: IO[bytes], writer: asyncssh.SSHWriter) -> None:
    """Send what a pipe has until its end, or until the connection is lost, which closes it."""
    reader = asyncio.StreamReader()
    loop = asyncio.get_running_loop()
    transport, _ = await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), pipe)
    lost = loop.create_task(writer.channel.wait_closed())
    lost.add_done_callback(lambda _: transport.close())
    try:
        while data := await reader.read(1 << 16):
            writer.write(data)
            await writer.drain()
        if lost.done():
            raise ConnectionResetError
    finally:
        transport.close()
