"""The HTTP application of the page, with the interface of ``docs/page.md``. Access is checked before it."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import anyio
from starlette.responses import Response, StreamingResponse
from starlette.routing import Route, Router

from rtf.errors import RtfError
from rtf.page import compare, files
from rtf.page.access import FILE_POLICY, Access, Guard
from rtf.page.assets import INDEX, read_assets
from rtf.page.errors import FileRefusedError, SeriesError
from rtf.page.requests import read_body
from rtf.page.responses import asset_response, error_response, json_response, text_response
from rtf.page.series import pack_file
from rtf.page.settings import LOG_NAME, Settings
from rtf.page.status import Status
from rtf.testing.journal import FILE_NAME

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Awaitable, Callable

    from starlette.requests import Request
    from starlette.types import ASGIApp

    from rtf.page.journal_feed import Feed

    #: Passes a request on to the run; the reply has the reason of a refusal in ``error`` and ``late``.
    Command = Callable[[dict[str, Any]], Awaitable[dict[str, Any]]]

#: The limit of a client's request, in bytes.
MAX_BODY = 64 << 10
#: Seconds between keep-alive messages of a quiet stream, and milliseconds until a client reconnects.
KEEP_ALIVE = 10.0
RETRY = 1000
_CHUNK = 1 << 16
#: The number of series that are unpacked, and of runs that are compared, at the same time.
_HEAVY = 2
_STAGES = (1, 2)


def make_application(settings: Settings, feed: Feed, command: Command | None) -> ASGIApp:
    """Return the application of a page, behind its guard. Without ``command`` the run cannot be controlled."""
    page = Page(settings, feed, command)
    routes = [
        Route("/", page.index),
        Route("/facts", page.facts),
        Route("/events", page.events),
        Route("/series/{path:path}", page.series),
        Route("/files/{path:path}", page.file),
        Route("/compare", page.compared),
        Route("/history", page.history),
        Route("/status", page.status),
        Route("/control/stop", page.stop, methods=["POST"]),
        Route("/control/answer", page.answer, methods=["POST"]),
        Route("/{name}", page.asset),
    ]
    return Guard(Router(routes, redirect_slashes=False), page.access)


class Page:
    """The handlers of the requests."""

    def __init__(self, settings: Settings, feed: Feed, command: Command | None) -> None:
        self.access = Access(settings.host, settings.port, settings.token)
        self._settings = settings
        self._folder = Path(settings.run_folder)
        self._feed = feed
        self._command = command
        self._status = Status(self._folder / FILE_NAME)
        self._heavy = asyncio.Semaphore(_HEAVY)
        self._assets = read_assets()
        self._compared: bytes | None = None

    # The page ----------------------------------------------------------------------------------------------------

    async def index(self, _request: Request) -> Response:
        """Return the page itself."""
        return asset_response(self._assets.get(INDEX))

    async def asset(self, request: Request) -> Response:
        """Return a file of the page."""
        return asset_response(self._assets.get(request.path_params["name"]))

    async def facts(self, _request: Request) -> Response:
        """Return the facts that the page needs at its start."""
        facts = {
            "mode": "live",
            "control": self._command is not None,
            "compare": self._settings.compare is not None,
            "history": self._settings.history is not None,
            "run": self._folder.name,
        }
        return json_response(200, facts)

    # The run -----------------------------------------------------------------------------------------------------

    async def events(self, request: Request) -> Response:
        """Stream the journal, from its beginning or from the position of a client that reconnects."""
        if request.method == "HEAD":
            return Response(media_type="text/event-stream")
        after = request.headers.get("last-event-id") or request.query_params.get("after") or "0"
        if not (after.isascii() and after.isdigit() and len(after) <= len(str(1 << 62))):
            return text_response(400, "Last-Event-ID must be a number of lines")
        return StreamingResponse(self._stream(int(after)), media_type="text/event-stream")

    async def _stream(self, after: int) -> AsyncIterator[bytes]:
        feed = self._feed
        run = json.dumps(self._folder.name)
        yield f"retry: {RETRY}\nevent: run\ndata: {run}\n\n".encode()
        with feed.followed():
            position = feed.position(after)
            ended = False
            while True:
                while position.offset < feed.end.offset:
                    message, position = feed.read(position)
                    yield message
                if feed.over and not ended:
                    ended = True
                    yield b"event: end\ndata: {}\n\n"
                if feed.closing:
                    return
                try:
                    async with asyncio.timeout(KEEP_ALIVE):
                        await feed.change()
                except TimeoutError:
                    yield b":\n\n"

    async def status(self, _request: Request) -> Response:
        """Return the status for scripts."""
        return json_response(200, await asyncio.to_thread(self._status.read))

    # Files and other runs-----------------------------------------------------------------------------------------

    async def series(self, request: Request) -> Response:
        """Return the columns of a recorded series."""
        try:
            path = files.inside(self._folder, request.path_params["path"])
            async with self._heavy:
                content = await asyncio.to_thread(pack_file, path)
        except (FileRefusedError, SeriesError) as error:
            return text_response(404, str(error))
        return Response(content, media_type=files.OPAQUE)

    async def file(self, request: Request) -> Response:
        """Return a file of the run folder: shown by the browser if its type is harmless, otherwise downloaded."""
        name = request.path_params["path"]
        try:
            path = files.inside(self._folder, name)
        except FileRefusedError as error:
            return text_response(404, str(error))
        if path.name == LOG_NAME:
            return text_response(404, "the log of the server is not shown")
        media_type = files.media_type(path)
        size = path.stat().st_size
        headers = {"content-length": str(size), "content-security-policy": FILE_POLICY}
        if not files.is_shown(media_type):
            headers["content-disposition"] = "attachment"
        if request.method == "HEAD":
            return Response(headers=headers, media_type=media_type)
        return StreamingResponse(_content(path, size), headers=headers, media_type=media_type)

    async def compared(self, _request: Request) -> Response:
        """Return the records of the run that this one is compared with."""
        run = self._settings.compare
        if run is None:
            return text_response(404, "there is no run to compare with")
        async with self._heavy:
            if self._compared is None:
                self._compared = await asyncio.to_thread(_compared, Path(run))
        return Response(self._compared, media_type="application/json")

    async def history(self, _request: Request) -> Response:
        """Return the trends of all runs."""
        path = self._settings.history
        if path is None:
            return text_response(404, "there is no history")
        try:
            async with self._heavy:
                content = await asyncio.to_thread(_trends, path, self._status)
        except RtfError as error:  # the file was deleted, or is that of another program
            return text_response(404, str(error))
        return Response(content, media_type="application/json")

    # Control -----------------------------------------------------------------------------------------------------

    async def stop(self, request: Request) -> Response:
        """Stop the run after the running test, or now."""
        given = await self._read_command(request)
        if isinstance(given, Response):
            return given
        if type(given.get("stage")) is not int or given["stage"] not in _STAGES:
            return error_response(400, 'the body must be {"stage": 1} (after this test) or {"stage": 2} (now)')
        return await self._pass_on({"stop": given["stage"]})

    async def answer(self, request: Request) -> Response:
        """Answer a question of a test."""
        given = await self._read_command(request)
        if isinstance(given, Response):
            return given
        words = [given.get(name) for name in ("test", "question", "answer")]
        if not all(isinstance(word, str) and _is_text(word) for word in words):
            return error_response(400, 'the body must be {"test": …, "question": …, "answer": …}, with texts only')
        return await self._pass_on({"answer": words})

    async def _read_command(self, request: Request) -> dict[str, Any] | Response:
        body = await read_body(request, self.access, MAX_BODY)
        if isinstance(body, Response):
            return body
        try:
            given = json.loads(body)
        except (ValueError, RecursionError):
            return error_response(400, "the body is not valid JSON")
        return given if isinstance(given, dict) else error_response(400, "the body must be a JSON object")

    async def _pass_on(self, command: dict[str, Any]) -> Response:
        if self._command is None:
            return error_response(409, "the run is over")
        try:
            said = await self._command(command)
        except (TimeoutError, ConnectionError):
            return error_response(503, "the runner does not answer")
        if "error" in said:
            return error_response(409 if said.get("late") else 400, str(said["error"]))
        return json_response(202, {})


def _is_text(word: str) -> bool:
    """Return whether a text can be encoded: JSON strings can have lone surrogates."""
    return word.encode(errors="replace").decode() == word


async def _content(path: Path, size: int) -> AsyncIterator[bytes]:
    """Yield ``size`` bytes of a file, which may be growing."""
    async with await anyio.open_file(path, "rb") as stream:
        while size and (chunk := await stream.read(min(_CHUNK, size))):
            size -= len(chunk)
            yield chunk


def _compared(run: Path) -> bytes:
    return json.dumps([*compare.records(run)], separators=(",", ":")).encode()


def _trends(place: str, status: Status) -> bytes:
    from rtf.testing.history import History, default_place, trends_for_a_run

    with History(Path(place) if place else default_place()) as history:
        found = trends_for_a_run(history, status.suites(), *status.rig())
    return json.dumps(found, separators=(",", ":"), allow_nan=False).encode()
