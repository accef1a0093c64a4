"""The server of a running campaign's page: what anybody may see, and what needs the token."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest

from rtf.campaigns.live_page import LivePage, serve_campaign
from rtf.campaigns.store import CampaignStore
from rtf.campaigns.tasks import Task

if TYPE_CHECKING:
    from pathlib import Path


def answer(address: str, body: bytes | None = None, **headers: str) -> tuple[int, bytes]:
    """Return status and body of the answer to a request; one with a body is a POST."""
    try:
        with urlopen(Request(address, body, headers)) as found:
            return found.status, found.read()
    except HTTPError as error:
        return error.code, error.read()


def test_looking_needs_no_token_and_stopping_does(tmp_path: Path):
    """The state of a campaign is for everybody at this machine; only the printed address stops it, while it runs."""
    stops: list[bool] = []
    path = tmp_path / "c.sqlite"
    with CampaignStore(path, create=True) as store:
        store.add([Task(test="a"), Task(test="b")])
    page = LivePage(path, "c")
    page.beside(lambda _: None, lambda *, drop: stops.append(drop))
    with serve_campaign(page, "127.0.0.1", 0) as printed:
        address, _, token = printed.partition("#token=")
        assert address.startswith("http://127.0.0.1:")
        status, body = answer(f"{address}progress")
        assert (status, json.loads(body)["counts"], json.loads(body)["state"]) == (200, {"waiting": 2}, "running")
        assert answer(f"{address}report")[0] == 404
        place, json_type = f"{address}control/stop", {"Content-Type": "application/json"}
        assert answer(place, b'{"drop": true}', **json_type)[0] == 401
        right = {"Authorization": f"Bearer {token}", **json_type}
        assert answer(place, b'{"drop": 1}', **right)[0] == 400
        assert answer(place, b'{"drop": true}', **right)[0] == 202
        assert answer(f"{address}progress", Host="other.example")[0] == 403
        page.end()
        assert answer(place, b'{"drop": true}', **right)[0] == 409
    assert stops == [True]


@pytest.mark.parametrize(("link", "shown"), [("http://127.0.0.1:8787/status", True), ("javascript:alert(1)", False)])
def test_the_address_of_a_dashboard_is_looked_at(link: str, shown: bool):
    """It is of the scheduler's choice, and a link of the page."""
    dask = pytest.importorskip("rtf.campaigns.backends.dask")
    assert dask.web_address(link) == (link if shown else "")
