"""The server process: it reads the growing journal and answers browsers, until the run, or a signal, ends it.

It is started by ``rtf.page.server_process`` with three open files: the listening socket, the channel to the runner, and
the eventfd by which the runner notifies it of new lines. When the channel closes, the runner has ended; the server
sends the rest and ends, too. Errors are written to its log and do not affect the run.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import select
import signal
import socket
from pathlib import Path
from typing import TYPE_CHECKING, Any

import uvicorn

from rtf.page.application import make_application
from rtf.page.journal_watch import Watch, is_written
from rtf.page.protocol import MAX_CONNECTIONS, MAX_REQUEST_HEAD, BoundedProtocol
from rtf.page.server_process import CHANNEL_FD, LISTENER_FD, MAX_LINE, POKE_FD
from rtf.page.settings import Settings
from rtf.testing.journal import FILE_NAME

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType

    from starlette.types import ASGIApp


#: Seconds for the clients to receive the rest at the end.
FAREWELL = 2.0
#: Seconds between two checks for remaining connections; and the number of loop iterations after which an accepted
#: connection is in uvicorn's list.
_TURN = 0.01
_ACCEPTING = 5
#: Seconds between two checks whether a run of another process is over.
_LOOK_FOR_END = 0.5
#: Seconds for an answer of the runner.
_ANSWER_TIME = 5.0


class Runner:
    """The other end of the channel, which gets requests and reports the end of the run."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader = reader
        self._writer = writer
        self._waiting: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self._count = 0

    async def command(self, command: dict[str, Any]) -> dict[str, Any]:
        """Pass a request on. Raises TimeoutError if the runner does not answer, ConnectionError if it has ended."""
        self._count += 1
        number = self._count
        answer: asyncio.Future[dict[str, Any]] = asyncio.get_running_loop().create_future()
        self._waiting[number] = answer
        try:
            self.say({"id": number, **command})
            async with asyncio.timeout(_ANSWER_TIME):
                return await answer
        finally:
            del self._waiting[number]

    def say(self, record: dict[str, Any]) -> None:
        """Send a line."""
        self._writer.write(json.dumps(record).encode() + b"\n")

    async def listen(self, watch: Watch) -> None:
        """Receive lines until the runner has ended."""
        while line := await self._reader.readline():
            record = json.loads(line)
            if "over" in record:
                watch.finish()
            elif (answer := self._waiting.get(record["id"])) is not None and not answer.done():
                answer.set_result(record)  # unless its time has ended in the same turn of the loop


class Server(uvicorn.Server):
    """uvicorn's server for an existing listening socket, until ``stopping`` is set; then ``end_streams`` is called."""

    def __init__(self, application: ASGIApp, end_streams: Callable[[], object] = lambda: None) -> None:
        super().__init__(
            uvicorn.Config(
                application,
                loop="asyncio",
                http=BoundedProtocol,
                ws="none",
                lifespan="off",
                interface="asgi3",
                log_config=None,
                log_level="error",
                access_log=False,
                proxy_headers=False,
                server_header=False,
                date_header=False,
                limit_concurrency=MAX_CONNECTIONS,
                h11_max_incomplete_event_size=MAX_REQUEST_HEAD,
            )
        )
        self._loop = asyncio.get_running_loop()
        self._end_streams = end_streams
        self.stopping = asyncio.Event()

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:  # noqa: ARG002 - uvicorn's signature
        """Handle a signal."""
        self._loop.call_soon_threadsafe(self.stopping.set)

    async def main_loop(self) -> None:
        """Wait for the end, without polling; then end the streams of the clients."""
        await self.stopping.wait()
        self._end_streams()

    async def accept_waiting(self, listener: socket.socket) -> None:
        """Accept the clients that connected before the server was ready."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(FAREWELL):
                while not self.started or select.select([listener], [], [], 0)[0]:  # noqa: ASYNC110 - as below
                    await asyncio.sleep(_TURN)
                for _ in range(_ACCEPTING):
                    await asyncio.sleep(0)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Complete pending responses for a moment, then close all connections."""
        connections: set[BoundedProtocol] = self.server_state.connections  # type: ignore[assignment]  # as configured
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(FAREWELL):
                while not all(connection.at_rest for connection in connections):  # noqa: ASYNC110
                    await asyncio.sleep(_TURN)
                for server in self.servers:
                    server.close()
                for connection in [*connections]:
                    connection.shutdown()
                while connections:  # noqa: ASYNC110 - uvicorn has no event for it
                    await asyncio.sleep(_TURN)
        for listener in sockets or []:
            listener.close()
        for connection in [*connections]:  # stalled ones are aborted
            connection.transport.abort()
        await asyncio.gather(*self.server_state.tasks, return_exceptions=True)


async def serve_run(settings: Settings, listener: socket.socket, channel: socket.socket, notifier: int) -> None:
    """Serve the page of a run, as long as its runner exists."""
    watch = Watch(Path(settings.run_folder) / FILE_NAME, notifier)
    watch.feed.grow()
    runner = Runner(*await asyncio.open_connection(sock=channel, limit=MAX_LINE))
    server = Server(make_application(settings, watch.feed, runner.command), watch.feed.close_streams)
    serving = asyncio.ensure_future(server.serve(sockets=[listener]))
    runner.say({"ready": True})
    listening = asyncio.ensure_future(runner.listen(watch))
    await asyncio.wait([serving, listening], return_when=asyncio.FIRST_COMPLETED)
    if not serving.done():
        watch.finish()
        await server.accept_waiting(listener)
        if server.server_state.connections:
            server.stopping.set()
            await serving
    os._exit(0)  # the run waits for this, and nothing is left to clean up


async def serve_folder(settings: Settings, listener: socket.socket) -> None:
    """Serve the page of a run from its folder, until a signal. A run that is not over is followed."""
    path = Path(settings.run_folder) / FILE_NAME
    watch = Watch(path, None)
    watch.feed.grow()
    server = Server(make_application(settings, watch.feed, None), watch.feed.close_streams)
    serving = asyncio.ensure_future(server.serve(sockets=[listener]))
    while not serving.done():
        if not watch.feed.over and not is_written(path):
            watch.finish()
        await asyncio.wait([serving], timeout=_LOOK_FOR_END)
    serving.result()


def main() -> None:
    """Run the server of a run, with the open files of the runner."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    channel = socket.socket(fileno=CHANNEL_FD)
    settings = Settings.from_line(_first_line(channel))
    asyncio.run(serve_run(settings, socket.socket(fileno=LISTENER_FD), channel, POKE_FD))


def _first_line(channel: socket.socket) -> bytes:
    line = b""
    while not line.endswith(b"\n"):
        byte = channel.recv(1)
        if not byte:
            raise SystemExit(0)  # the runner has closed the channel
        line += byte
    return line
