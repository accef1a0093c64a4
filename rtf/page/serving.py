"""A page served by a thread of this process: those of logs and applications."""

from __future__ import annotations

import asyncio
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rtf.page.access import Access
from rtf.page.server import Server
from rtf.page.server_process import listen
from rtf.page.settings import address_of

if TYPE_CHECKING:
    import socket
    from collections.abc import Callable, Iterator

    from starlette.types import ASGIApp

#: Seconds for the server to start.
_START = 10.0


@contextmanager
def serve(make: Callable[[Access], ASGIApp], host: str, port: int, token: str = "") -> Iterator[str]:
    """Serve a page while the block runs, and give its address, without the token.

    ``make`` returns the application, in the thread of the server. Raises ReportError if the port cannot be opened.
    """
    serving = _Serving(make, listen(host, port), host, token)
    try:
        yield serving.start()
    finally:
        serving.stop()


class _Serving:
    """The thread of a server."""

    def __init__(self, make: Callable[[Access], ASGIApp], listener: socket.socket, host: str, token: str) -> None:
        self._make = make
        self._listener = listener
        self._host, self._port, self._token = host, listener.getsockname()[1], token
        self._loop = asyncio.new_event_loop()
        self._started = threading.Event()
        self._thread = threading.Thread(target=self._run, name="rtf-page", daemon=True)

    def start(self) -> str:
        self._thread.start()
        self._started.wait(_START)
        return address_of(self._host, self._port)

    def stop(self) -> None:
        self._loop.call_soon_threadsafe(self._server.stopping.set)
        self._thread.join()
        self._loop.close()

    def _run(self) -> None:
        self._loop.run_until_complete(self._serve())

    async def _serve(self) -> None:
        self._server = Server(self._make(Access(self._host, self._port, self._token)))
        self._started.set()
        await self._server.serve(sockets=[self._listener])
