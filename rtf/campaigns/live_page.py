"""The page of a campaign while it runs: how far it is, the latest results, and the report of those that are there.

The page is that of ``rtf campaign report``. A thread of the campaign's process serves it; the report is made by another
process, and only while somebody looks, so that the campaign is not slowed down by its statistics.
"""

from __future__ import annotations

import asyncio
import secrets
import subprocess
import sys
import tempfile
import threading
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
from starlette.responses import Response
from starlette.routing import Route, Router

from rtf import clock
from rtf.campaigns.store import AGAIN, CampaignStore, State
from rtf.page.access import Guard
from rtf.page.assets import read_assets
from rtf.page.requests import read_body
from rtf.page.responses import asset_response, error_response, json_response, text_response
from rtf.page.serving import serve
from rtf.testing.history import HistoryError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from starlette.requests import Request
    from starlette.types import ASGIApp

    from rtf.campaigns.conductor import Progress
    from rtf.campaigns.outcomes import Outcome
    from rtf.page.access import Access

#: The page of a campaign among the files of all pages.
INDEX = "campaign.html"
#: Rows of each list, and the limit of a request in bytes.
_SHOWN, _MOST_BODY = 20, 1 << 10
#: Seconds between two reports at least, and as a multiple of what the last one took; the nice value of their process.
_PAUSE, _SHARE = 5.0, 10.0
_START = "import os, sys; os.nice(5); from rtf.cli.tools import main; sys.exit(main())"
_TOKEN_BYTES = 16


class Stop(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A request to stop: with ``drop`` running tasks are ended, too."""

    drop: bool


class LivePage:
    """The page of a campaign, by the path of its results. Its handlers are called in the thread of the server."""

    def __init__(self, path: Path, name: str) -> None:
        self._path = path
        self._name = name
        self._stop: Callable[..., None] | None = None
        self._progress: Progress | None = None
        self._assets = read_assets()
        self._reports = _Reports(path)

    def beside(
        self, show: Callable[[Progress], None], stop: Callable[..., None] = lambda **_: None
    ) -> Callable[[Progress], None]:
        """Return what a conductor calls that has ``stop``: it shows how far the campaign is here, too."""
        self._stop = stop

        def both(progress: Progress) -> None:
            self._progress = progress
            show(progress)

        return both

    def end(self) -> None:
        """Note that nothing is running any more."""
        self._stop = None

    def close(self) -> None:
        """End the process of a report."""
        self._reports.close()

    def application(self, access: Access) -> ASGIApp:
        """Return the application of the page, behind its guard."""
        self._access = access
        routes = [
            Route("/", self.index),
            Route("/progress", self.progress),
            Route("/report", self.report),
            Route("/control/stop", self.stop, methods=["POST"]),
            Route("/{name}", self.asset),
        ]
        return Guard(Router(routes, redirect_slashes=False), access, log="the output of the program")

    async def index(self, _request: Request) -> Response:
        """Return the page itself."""
        return asset_response(self._assets.get(INDEX))

    async def asset(self, request: Request) -> Response:
        """Return a file of the page."""
        return asset_response(self._assets.get(request.path_params["name"]))

    async def progress(self, _request: Request) -> Response:
        """Return how far the campaign is, with the latest results; and see to it that there is a report of them."""
        try:
            return json_response(200, await asyncio.to_thread(self._state))
        except HistoryError as error:
            return text_response(503, str(error))

    async def report(self, _request: Request) -> Response:
        """Return the data of the latest report, as they are in the page that is one file."""
        if not self._reports.latest:
            return text_response(404, "there is no report yet")
        return Response(self._reports.latest, media_type="application/json")

    async def stop(self, request: Request) -> Response:
        """Stop the campaign: begin no further run, and with ``drop`` end those that are going on."""
        body = await read_body(request, self._access, _MOST_BODY)
        if isinstance(body, Response):
            return body
        try:
            wanted = msgspec.json.decode(body, type=Stop)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            return error_response(400, 'want {"drop": true} or {"drop": false}')
        if self._stop is None:
            return error_response(409, "the campaign is not running")
        self._stop(drop=wanted.drop)
        return json_response(202, {})

    def _state(self) -> dict[str, Any]:
        progress, running = self._progress, self._stop is not None
        with CampaignStore(self._path) as store:
            counts, latest, endings = store.counts(), store.latest(_SHOWN), store.endings()
        self._reports.refresh(sum(counts.get(state, 0) for state in (State.DONE, State.KILLED)))
        stopping = progress is not None and progress.stopping
        return {
            "name": self._name,
            "state": "over" if not running else "stopping" if stopping else "running",
            "counts": counts,
            "remaining": progress.remaining if progress else None,
            "running": progress.running[:_SHOWN] if progress and running else [],
            "robots": dict(progress.robots) if progress and running else {},
            "workers": progress.workers if progress else "",
            "dashboard": progress.dashboard if progress else "",
            "latest": [_plain(outcome) for outcome in latest],
            "endings": [[task.described, state, detail] for task, state, detail in endings[-_SHOWN:]],
            "ended": sum(counts.get(state, 0) for state in AGAIN),
            "reported": self._reports.size,
        }


def _plain(outcome: Outcome) -> dict[str, Any]:
    robot = f"{outcome.robot} unit {outcome.unit}" if outcome.unit else outcome.robot
    return {
        "test": outcome.test,
        "robot": robot,
        "fault": " ".join(filter(None, (outcome.fault, outcome.joint))),
        "severity": outcome.severity,
        "verdict": outcome.verdict,
        "named": outcome.named or "",
        "seconds": outcome.seconds,
    }


class _Reports:
    """Makes reports of the campaign's file, one at a time, by ``rtf campaign report`` in a process of its own.

    ``latest`` is the newest one as JSON, ``size`` the number of results that there were when it was begun.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.latest, self.size = b"", 0
        self._due = clock.Deadline.after(0.0)
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._closed = False

    def refresh(self, size: int) -> None:
        """Begin a report, if there are other results than the last one had, and it is time."""
        with self._lock:
            if size == self.size or not self._due.expired or self._process is not None or self._closed:
                return
            place = tempfile.TemporaryDirectory(prefix="rtf-campaign-page-")
            folder = Path(place.name)
            words = ["campaign", "report", str(self._path), "-o", str(folder / "page"), "--json", str(folder / "json")]
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", _START, *words],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
        threading.Thread(target=self._finish, args=(place, size), name="rtf-report", daemon=True).start()

    def _finish(self, place: tempfile.TemporaryDirectory[str], size: int) -> None:
        process, began = self._process, clock.monotonic()
        assert process is not None
        process.wait()
        with place, self._lock:
            made = Path(place.name) / "json"
            if made.exists():
                self.latest, self.size = made.read_bytes(), size
            self._process = None
            self._due = clock.Deadline.after(max(_PAUSE, _SHARE * (clock.monotonic() - began)))

    def close(self) -> None:
        """End what is going on."""
        with self._lock:
            self._closed = True
            if self._process is not None:
                self._process.kill()


@contextmanager
def serve_campaign(page: LivePage, host: str, port: int) -> Iterator[str]:
    """Serve the page of a campaign while the block runs, and give its address with the token.

    Raises ReportError if the port cannot be opened.
    """
    token = secrets.token_urlsafe(_TOKEN_BYTES)
    try:
        with serve(page.application, host, port, token) as address:
            yield f"{address}#token={token}"
    finally:
        page.close()
