"""The server side of a log's page: windows on the records, one record whole, and what it refuses."""

from __future__ import annotations

import json
from http.client import HTTPConnection
from typing import TYPE_CHECKING, Any
from urllib.parse import urlencode, urlsplit

import pytest

from rtf.logs import store
from rtf.logs.record import Level, LogRecord
from rtf.logs.store import LogFileError, LogStore
from rtf.page.log_page import MOST_TEXT, serve_log
from rtf.testing.reporting import ReportError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

RECORDS = [
    LogRecord(
        f"/log/pc{number % 2}/arm/{number % 3}",
        Level.ERROR if number % 10 == 0 else Level.INFO,
        float(number),
        f"step {number}",
        f"lab.part{number % 4}",
    )
    for number in range(1, 101)
]
LONG = LogRecord(
    "/log/pc0/arm/7", Level.FATAL, 200.0, "x" * 1000, "lab", "left", '(line 88) (limit inf) (file "/a b")', "main:1"
)


class Client:
    """Asks the server of a page."""

    def __init__(self, address: str) -> None:
        self.place = urlsplit(address).netloc

    def get(self, path: str, **headers: str) -> tuple[int, bytes, dict[str, str]]:
        """Return status, body and headers."""
        connection = HTTPConnection(self.place, timeout=30)
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        found = answer.status, answer.read(), {key.lower(): value for key, value in answer.headers.items()}
        connection.close()
        return found

    def window(self, **words: object) -> dict[str, Any]:
        """Return a window on the records."""
        status, body, _ = self.get(f"/records?{urlencode(words)}")
        assert status == 200, body
        found: dict[str, Any] = json.loads(body)
        return found

    def numbers(self, **words: object) -> list[int]:
        """Return the numbers of the records in a window."""
        return [record["number"] for record in self.window(**words)["records"]]


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    """The page of a log of 101 records, of which ten numbers are looked through at once."""
    file = tmp_path_factory.mktemp("log") / "logs.sqlite"
    with LogStore(file) as opened:
        opened.add([(record.time, record) for record in [*RECORDS, LONG]])
    with pytest.MonkeyPatch.context() as patch, serve_log(file, "127.0.0.1", 0) as address:
        patch.setattr(store, "SCAN", 10)
        yield Client(address)


def test_the_page_and_its_files(client: Client):
    """The page and its modules are served as they are, with the facts; files of other folders are not."""
    status, body, headers = client.get("/")
    assert (status, headers["content-type"]) == (200, "text/html; charset=utf-8")
    assert b"logs.js" in body
    assert "script-src 'self'" in headers["content-security-policy"]
    assert client.get("/logs_window.js")[0] == 200
    assert json.loads(client.get("/facts")[1])["file"].endswith("logs.sqlite")
    assert client.get("/..%2fweb.py")[0] == 404


def test_a_window_is_bounded_and_says_what_it_looked_through(client: Client):
    """A reply has the records of a part of the log, its edges, and the ends of the log."""
    window = client.window()
    assert [record["number"] for record in window["records"]] == [*range(92, 102)]
    assert {key: window[key] for key in ("low", "high", "oldest", "newest")} == {
        "low": 91,
        "high": 101,
        "oldest": 1,
        "newest": 101,
    }
    assert client.numbers(high=91, count=3) == [89, 90, 91]
    assert client.numbers(low=91, side="oldest", count=2) == [92, 93]
    assert client.window(side="oldest")["high"] == 10
    assert client.window(high=0) | {"records": []} == {"records": [], "low": 0, "high": 0, "oldest": 1, "newest": 101}
    nothing_there = client.window(level="error", high=99)
    assert ([record["number"] for record in nothing_there["records"]], nothing_there["low"]) == ([90], 89)


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        ({"level": "error", "high": 100}, [100]),
        ({"process": "arm", "host": "pc1", "count": 2, "high": 100}, [97, 99]),
        ({"component": "lab.part2", "high": 100}, [94, 98]),
        ({"text": "STEP 9", "count": 1, "high": 99}, [99]),
        ({"since": "1970-01-01T00:01:35+00:00", "high": 100}, [95, 96, 97, 98, 99, 100]),
        ({"until": "1970-01-01T00:01:32+00:00", "high": 100}, [91, 92]),
        ({"level": ""}, [*range(92, 102)]),
    ],
    ids=str,
)
def test_the_filters_are_those_of_the_command(client: Client, words: dict[str, object], wanted: list[int]):
    """Each filter of ``rtf log`` works; an empty one wants all."""
    assert client.numbers(**words) == wanted


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        ({"level": "loud"}, "'loud' is no level; the levels are unknown, trace"),
        ({"since": "yesterday"}, "'yesterday' is no time; write how long ago"),
        ({"side": "left"}, "side is newest or oldest"),
        ({"low": "-1"}, "low is a whole number"),
        ({"high": "9" * 40}, "high is a whole number"),
        ({"count": "٣"}, "count is a whole number"),
    ],
)
def test_what_is_wrong_is_said(client: Client, words: dict[str, object], problem: str):
    """A request that cannot be answered is refused with the reason."""
    status, body, _ = client.get(f"/records?{urlencode(words)}")
    assert status == 400
    assert problem in body.decode()


def test_a_long_message_is_cut_until_its_record_is_asked_for(client: Client):
    """In a window a message has its first characters; the record by itself has all, and its groups as texts."""
    (brief,) = client.window(level="fatal")["records"]
    assert brief["message"] == "x" * MOST_TEXT
    whole = json.loads(client.get("/records/101")[1])
    assert whole["message"] == LONG.message
    assert whole["groups"] == {"line": "88", "limit": "inf", "file": "/a b"}
    assert (whole["id"], whole["backtrace"], whole["arrived"]) == ("left", "main:1", 200.0)
    for number in ("0", "102", "9" * 40, "x"):
        assert client.get(f"/records/{number}")[0] == 404


def test_pages_of_others_get_nothing(client: Client):
    """The host and the origin of a request must be those of the server, as for the page of a run."""
    assert client.get("/records", Host="evil.example")[0] == 403
    assert client.get("/records", Origin="http://evil.example")[0] == 403


def test_a_file_that_is_none_is_reported_at_once(tmp_path: Path):
    """A file that is missing, and a port that is taken, are errors before anything is served."""
    with pytest.raises(LogFileError, match="there is no log"), serve_log(tmp_path / "none.sqlite", "127.0.0.1", 0):
        pass
    file = tmp_path / "logs.sqlite"
    LogStore(file).close()
    with (
        serve_log(file, "127.0.0.1", 0) as address,
        pytest.raises(ReportError, match="is in use"),
        serve_log(file, "127.0.0.1", urlsplit(address).port or 0),
    ):
        pass


def test_a_file_that_goes_away_is_said(tmp_path: Path):
    """A log that is deleted while its page is shown is an answer, and no failure of the server."""
    file = tmp_path / "logs.sqlite"
    LogStore(file).close()
    with serve_log(file, "127.0.0.1", 0) as address:
        assert Client(address).window()["newest"] == 0
        file.unlink()
        status, body, _ = Client(address).get("/records")
    assert status == 503
    assert b"there is no log" in body
