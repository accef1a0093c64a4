"""The page of a log: a window on its records, read from the file that a collector writes.

A request looks through a limited number of records and replies with those that are wanted and with the part that it
has looked through; the browser goes on from there. So a log of any size is shown at once, and nothing is kept here.
"""

from __future__ import annotations

import asyncio
from contextlib import contextmanager
from dataclasses import fields
from functools import partial
from typing import TYPE_CHECKING, Any

from starlette.routing import Route, Router

from rtf.logs.query import Query, read_level, read_moment
from rtf.logs.store import LogFileError, LogReader
from rtf.page.access import Guard
from rtf.page.assets import read_assets
from rtf.page.responses import asset_response, json_response, text_response
from rtf.page.serving import serve

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from starlette.requests import Request
    from starlette.responses import Response
    from starlette.types import ASGIApp

    from rtf.logs.store import Stored, Window
    from rtf.page.access import Access

#: The page of a log among the files of all pages.
INDEX = "logs.html"
#: The most records of a reply, and the most characters of a message in it; the rest comes with the record by itself.
MOST_RECORDS = 1000
MOST_TEXT = 400
#: Requests that read the file at the same time; a scan keeps a processor busy.
_READERS = 2
_LARGEST = (1 << 63) - 1


class BadRequestError(ValueError):
    """A request that cannot be answered; the message says what is wrong."""


class LogPage:
    """The handlers of the requests. Every request opens the file, which another program may have replaced."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._assets = read_assets()
        self._readers = asyncio.Semaphore(_READERS)

    async def index(self, _request: Request) -> Response:
        """Return the page itself."""
        return asset_response(self._assets.get(INDEX))

    async def asset(self, request: Request) -> Response:
        """Return a file of the page."""
        return asset_response(self._assets.get(request.path_params["name"]))

    async def facts(self, _request: Request) -> Response:
        """Return the facts that the page needs at its start."""
        return json_response(200, {"mode": "log", "file": str(self._file)})

    async def records(self, request: Request) -> Response:
        """Return a window on the wanted records; see :meth:`LogReader.window` for ``low``, ``high`` and ``side``."""
        try:
            query, part = query_of(request.query_params), _range(request.query_params)
        except BadRequestError as error:
            return text_response(400, str(error))
        return await self._answer(lambda: _read_window(self._file, query, **part))

    async def record(self, request: Request) -> Response:
        """Return one record whole."""
        number = min(request.path_params["number"], _LARGEST)
        return await self._answer(lambda: _read_record(self._file, number))

    async def _answer(self, read: Callable[[], dict[str, Any] | None]) -> Response:
        try:
            async with self._readers:
                found = await asyncio.to_thread(read)
        except LogFileError as error:
            return text_response(503, str(error))
        if found is None:
            return text_response(404, "there is no such record; it may have been removed")
        return json_response(200, found)


def make_log_application(file: Path, access: Access) -> ASGIApp:
    """Return the application of the page of a log, behind its guard."""
    page = LogPage(file)
    routes = [
        Route("/", page.index),
        Route("/facts", page.facts),
        Route("/records", page.records),
        Route("/records/{number:int}", page.record),
        Route("/{name}", page.asset),
    ]
    return Guard(Router(routes, redirect_slashes=False), access, log="the output of the program")


# Requests -------------------------------------------------------------------------------------------------------------


def query_of(words: Mapping[str, str]) -> Query:
    """Read the filters of a request, which are those of ``rtf log``. Raises BadRequestError."""
    given = {field.name: words[field.name] for field in fields(Query) if words.get(field.name)}
    wanted: dict[str, Any] = dict(given)
    try:
        if "level" in given:
            wanted["level"] = read_level(given["level"])
        for name in {"since", "until"} & given.keys():
            wanted[name] = read_moment(given[name])
    except ValueError as error:
        raise BadRequestError(str(error)) from None
    return Query(**wanted)


def _range(words: Mapping[str, str]) -> dict[str, Any]:
    side = words.get("side", "newest")
    if side not in ("newest", "oldest"):
        raise BadRequestError(f"side is newest or oldest, not {side!r}")
    numbers = {"low": 0, "high": _LARGEST, "count": MOST_RECORDS}
    for name, most in (("low", _LARGEST), ("high", _LARGEST), ("count", MOST_RECORDS)):
        word = words.get(name, "")
        if word and not (word.isascii() and word.isdigit() and len(word) <= len(str(_LARGEST))):
            raise BadRequestError(f"{name} is a whole number, not {word!r}")
        numbers[name] = min(most, int(word)) if word else numbers[name]
    return {"newest": side == "newest", **numbers, "count": max(1, numbers["count"])}


def _read_window(file: Path, query: Query, *, low: int, high: int, count: int, newest: bool) -> dict[str, Any]:
    with LogReader(file) as reader:
        oldest, last = reader.ends()
        low = max(low, oldest - 1)
        window: Window = reader.window(query, low, min(high, last), count, newest=newest)
    records = [_brief(stored) for stored in window.records]
    return {"records": records, "low": window.low, "high": window.high, "oldest": oldest, "newest": last}


def _read_record(file: Path, number: int) -> dict[str, Any] | None:
    with LogReader(file) as reader:
        found = reader.record(number)
    if found is None:
        return None
    _, arrived, record = found
    groups = {key: str(value) for key, value in record.groups().items()}
    whole = {"arrived": arrived, "message": record.message, "id": record.id, "backtrace": record.backtrace}
    return {**_brief(found), **whole, "groups": groups}


def _brief(stored: Stored) -> dict[str, Any]:
    number, _, record = stored
    return {
        "number": number,
        "time": record.time,
        "level": record.level.name.lower(),
        "sender": record.sender,
        "component": record.component,
        "message": record.message[:MOST_TEXT],
    }


# Serving --------------------------------------------------------------------------------------------------------------


@contextmanager
def serve_log(file: Path, host: str, port: int) -> Iterator[str]:
    """Serve the page of a log by a thread of this process while the block runs, and give the address of the page.

    Raises LogFileError, and ReportError if the port cannot be opened.
    """
    with LogReader(file):
        pass
    with serve(partial(make_log_application, file), host, port) as address:
        yield address
