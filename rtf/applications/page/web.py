"""The server of the page of applications: what it shows without a token, and what it does with one.

Everything that names programs or ports to be looked for needs the token, too: a check asks the network for them.
"""

from __future__ import annotations

import asyncio
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

import msgspec
from starlette.responses import Response
from starlette.routing import Route, Router

from rtf.applications.errors import ApplicationError, TakenError
from rtf.applications.page.document import ChangedError, parse_document
from rtf.applications.page.view import ENCODER, palette, view_of
from rtf.errors import RtfError
from rtf.page.access import Guard
from rtf.page.assets import read_assets
from rtf.page.requests import read_body
from rtf.page.responses import asset_response, error_response, text_response
from rtf.page.serving import serve
from rtf.xml_tree import XmlError

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Iterator, Sequence

    from starlette.requests import Request
    from starlette.types import ASGIApp

    from rtf.applications.page.control import ControlledApplication
    from rtf.page.access import Access

#: The page of applications among the files of all pages.
INDEX = "applications.html"
#: The limit of a request in bytes: an application of a thousand modules has less than a megabyte.
MAX_BODY = 8 << 20


#: The most ports whose rates are measured at the same time.
_MEASURED = 4


class Chosen(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a request is about: modules by their tags, connections by their keys; without any of a kind, all."""

    modules: tuple[str, ...] | None = None
    connections: tuple[str, ...] | None = None


class ApplicationsPage:
    """The handlers of the requests."""

    def __init__(self, applications: Sequence[ControlledApplication], access: Access) -> None:
        self._applications = applications
        self._access = access
        self._assets = read_assets()
        self._measuring = asyncio.Semaphore(_MEASURED)
        self._reading = asyncio.Semaphore(1)  # a check keeps a processor busy

    def routes(self) -> list[Route]:
        """Return where each handler is found."""
        place = "/applications/{index:int}"
        return [
            Route("/", self.index),
            Route("/facts", self.facts),
            Route(f"{place}/status", self._of_one(self.status)),
            Route(f"{place}/document", self._of_one(self.document)),
            Route(f"{place}/palette", self._of_one(self.palette)),
            Route(f"{place}/output", self._of_one(self.output)),
            *(
                Route(f"{place}/{word}", self._of_one(partial(self._change, work)), methods=["POST"])
                for word, work in (("check", self.check), ("save", self.save), ("rate", self.rate), *self._controls())
            ),
            Route("/{name}", self.asset),
        ]

    def _controls(self) -> Iterator[tuple[str, Callable[[ControlledApplication, bytes], Awaitable[Response]]]]:
        """Yield the requests that control an application, by the words of their addresses."""
        yield "run", partial(_control, lambda one, chosen: one.run(chosen.modules))
        yield "stop", partial(_control, lambda one, chosen: one.stop(chosen.modules))
        yield "kill", partial(_control, lambda one, chosen: one.stop(chosen.modules, kill=True))
        yield "connect", partial(_control, lambda one, chosen: one.connect(chosen.connections))
        yield "disconnect", partial(_control, lambda one, chosen: one.disconnect(chosen.connections))

    def _of_one(self, handle: Callable[[ControlledApplication, Request], Awaitable[Response]]) -> Callable[..., Any]:
        """Return a handler that finds the application, and answers errors."""

        async def handled(request: Request) -> Response:
            index = request.path_params["index"]
            if index >= len(self._applications):
                return error_response(404, "there is no such application")
            try:
                return await handle(self._applications[index], request)
            except (ChangedError, TakenError) as error:
                return error_response(409, str(error))
            except XmlError as error:
                return error_response(422, f"{error.location}: {error.message}")
            except RtfError as error:
                return error_response(400, str(error))

        return handled

    # Looking ---------------------------------------------------------------------------------------------------------

    async def index(self, _request: Request) -> Response:
        """Return the page itself."""
        return asset_response(self._assets.get(INDEX))

    async def asset(self, request: Request) -> Response:
        """Return a file of the page."""
        return asset_response(self._assets.get(request.path_params["name"]))

    async def facts(self, _request: Request) -> Response:
        """Return the applications."""
        return _json({"mode": "applications", "files": [str(one.path) for one in self._applications]})

    async def status(self, one: ControlledApplication, request: Request) -> Response:
        """Return how an application is, and what happened after a sentence that the client has."""
        after = request.query_params.get("after", "0")
        if not (after.isascii() and after.isdigit() and len(after) <= len(str(1 << 62))):
            return text_response(400, "after must be a number")
        return _json(await asyncio.to_thread(one.status, int(after)))

    async def document(self, one: ControlledApplication, _request: Request) -> Response:
        """Return the file, and its view by the file alone."""
        return await self._view(lambda: view_of(one.path, one.variables, None))

    async def palette(self, one: ControlledApplication, _request: Request) -> Response:
        """Return the programs that can be added."""
        async with self._reading:
            return _json(await asyncio.to_thread(palette, one.path.parent))

    async def output(self, one: ControlledApplication, request: Request) -> Response:
        """Return the last lines of a module."""
        return _json(await asyncio.to_thread(one.output, request.query_params.get("module", "")))

    async def _view(self, read: Callable[[], tuple[object, object]]) -> Response:
        async with self._reading:
            document, view = await asyncio.to_thread(read)
        return _json({"document": document, "view": view})

    # Changing --------------------------------------------------------------------------------------------------------

    async def _change(
        self,
        work: Callable[[ControlledApplication, bytes], Awaitable[Response]],
        one: ControlledApplication,
        request: Request,
    ) -> Response:
        body = await read_body(request, self._access, MAX_BODY)
        return body if isinstance(body, Response) else await work(one, body)

    async def check(self, one: ControlledApplication, body: bytes) -> Response:
        """Return the view of an application with changes, which are not saved."""
        document = parse_document(body)
        return await self._view(lambda: view_of(one.path, one.variables, document, one.network()))

    async def rate(self, one: ControlledApplication, body: bytes) -> Response:
        """Measure the rate of a connection, and return it."""
        keys = _chosen(body).connections or ()
        if len(keys) != 1:
            raise ApplicationError("the rate of one connection at a time can be measured")
        async with self._measuring:
            return _json(await asyncio.to_thread(one.rate, keys[0]))

    async def save(self, one: ControlledApplication, body: bytes) -> Response:
        """Write the file, and return it as :meth:`document`."""
        document = parse_document(body)
        await asyncio.to_thread(one.save, document)
        return await self._view(lambda: view_of(one.path, one.variables, None, one.network()))


async def _control(
    work: Callable[[ControlledApplication, Chosen], None], one: ControlledApplication, body: bytes
) -> Response:
    await asyncio.to_thread(work, one, _chosen(body))
    return _json({}, 202)


def _chosen(body: bytes) -> Chosen:
    try:
        return msgspec.json.decode(body, type=Chosen)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ApplicationError(f"the request names no modules or connections: {error}") from None


def _json(value: object, status: int = 200) -> Response:
    return Response(ENCODER.encode(value), status, media_type="application/json")


def make_application(applications: Sequence[ControlledApplication], access: Access) -> ASGIApp:
    """Return the application of the page, behind its guard."""
    page = ApplicationsPage(applications, access)
    return Guard(Router(page.routes(), redirect_slashes=False), access, log="the output of the program")


@contextmanager
def serve_applications(
    applications: Sequence[ControlledApplication], host: str, port: int, token: str
) -> Iterator[str]:
    """Serve the page of applications while the block runs, and give its address with the token."""
    with serve(partial(make_application, applications), host, port, token) as address:
        yield f"{address}#token={token}"
