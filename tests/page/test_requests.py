"""Requests of a browser during a run."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import numpy as np
import pytest

from rtf.page.assets import page_folder

if TYPE_CHECKING:
    from live_page import LiveRun


def test_the_page_and_its_files_are_served_as_they_are(waiting: LiveRun):
    """The page's files are served with their types, and no others."""
    assert waiting.page.get("/").headers["content-type"] == "text/html; charset=utf-8"
    for path in page_folder().glob("*.js"):
        answer = waiting.page.get(f"/{path.name}")
        assert (answer.status, answer.body) == (200, path.read_bytes())
        assert answer.headers["content-type"] == "text/javascript; charset=utf-8"
    assert waiting.page.get("/page.css").headers["content-type"] == "text/css; charset=utf-8"
    for path in ("/favicon.ico", "/../web.py", "/..%2fweb.py", "/%2e%2e/web.py", "/web.py", "/page.css/"):
        assert waiting.page.get(path).status == 404


def test_the_facts(waiting: LiveRun):
    """The facts have mode, control, comparison, history and run."""
    facts = waiting.page.get("/facts").json
    assert facts == {
        "mode": "live",
        "control": True,
        "compare": False,
        "history": False,
        "run": waiting.run_folder.name,
    }


def test_status_has_the_cpp_framework_two_keys(waiting: LiveRun):
    """The status has the two keys of the C++ framework."""
    assert waiting.page.get("/status").json == {"name": "waiting", "testStatus": [1, 0]}


def test_a_late_client_gets_everything_and_a_returning_one_the_rest(waiting: LiveRun):
    """A client gets all events, or those after the position in its header or query."""
    journal = [json.loads(line) for line in (waiting.run_folder / "journal.jsonl").read_text().splitlines()]
    assert journal[-1]["event"] == "asked"

    def told(path: str, **headers: str) -> list[dict[str, Any]]:
        connection = waiting.page.connect()
        connection.request("GET", path, headers={name.replace("_", "-"): value for name, value in headers.items()})
        response = connection.getresponse()
        assert response.headers["content-type"] == "text/event-stream; charset=utf-8"
        lines = [response.readline().decode() for _ in range(4)]
        assert lines == ["retry: 1000\n", "event: run\n", f'data: "{waiting.run_folder.name}"\n', "\n"]
        records, number = [], ""
        while number != f"id: {len(journal)}\n":  # in one message, or as the first client got it while it was written
            number, data, _ = (response.readline().decode() for _ in range(3))
            records += json.loads(data.removeprefix("data: "))
        connection.close()
        return records

    for path, headers, after in [
        ("/events", {}, 0),
        ("/events?after=3", {}, 3),
        ("/events", {"Last_Event_ID": "4"}, 4),
        ("/events?after=3", {"Last_Event_ID": "4"}, 4),
    ]:
        assert told(path, **headers) == journal[after:]


@pytest.mark.parametrize("after", ["-1", "x", "1.5", "٣", "1" * 400, " ", "0x1"])
def test_a_place_that_is_none_is_refused(waiting: LiveRun, after: str):
    """An invalid position is refused."""
    assert waiting.page.get(f"/events?after={quote(after)}").status == 400


def test_events_have_a_head(waiting: LiveRun):
    """A HEAD request is answered without waiting for events."""
    assert waiting.page.ask("HEAD", "/events").headers["content-type"].startswith("text/event-stream")


def test_files_of_the_run_are_shown_or_kept(waiting: LiveRun):
    """Images and text are shown, other files downloaded, all of them sandboxed."""
    folder = waiting.run_folder / "files"
    folder.mkdir(exist_ok=True)
    (folder / "a b.png").write_bytes(b"\x89PNG")
    (folder / "evil.html").write_bytes(b"<script>alert(1)</script>")
    picture = waiting.page.get("/files/files/a%20b.png")
    assert (picture.status, picture.body, picture.headers["content-type"]) == (200, b"\x89PNG", "image/png")
    assert "sandbox" in picture.headers["content-security-policy"]
    assert "content-disposition" not in picture.headers
    evil = waiting.page.get("/files/files/evil.html")
    assert evil.headers["content-type"] == "application/octet-stream"
    assert evil.headers["content-disposition"] == "attachment"
    assert "sandbox" in evil.headers["content-security-policy"]
    head = waiting.page.ask("HEAD", "/files/files/evil.html")
    assert (head.body, head.headers["content-length"]) == (b"", str(len(evil.body)))
    journal = waiting.page.get("/files/journal.jsonl")
    assert journal.body == (waiting.run_folder / "journal.jsonl").read_bytes()


@pytest.mark.parametrize(
    "path",
    [
        *("../suite.xml", "..%2fsuite.xml", "%2e%2e/suite.xml", "%2e%2e%2fsuite.xml", "files/..%2f..%2fsuite.xml"),
        *("/etc/passwd", "%2fetc%2fpasswd", "..%5csuite.xml", "%00", "journal.jsonl%00.png", "", ".", "files"),
        *("web-server.log", "%ff%fe", "x" * 5000),
    ],
)
def test_no_path_leads_out_of_the_run(waiting: LiveRun, path: str):
    """Paths out of the run's folder are refused in any encoding, and so is the server's log."""
    for place in ("files", "series"):
        answer = waiting.page.get(f"/{place}/{path}")
        assert answer.status == 404
        assert b"suite" not in answer.body.replace(b"suite.xml", b"")


def test_a_series_is_sent_packed(waiting: LiveRun):
    """A series is sent in the documented binary form; a file that is none is refused."""
    folder = waiting.run_folder / "files"
    folder.mkdir(exist_ok=True)
    np.savez(folder / "elbow.npz", t=np.arange(3.0), position=np.array([1.0, np.nan, 3.0]))
    answer = waiting.page.get("/series/files/elbow.npz")
    assert answer.headers["content-type"] == "application/octet-stream"
    head, values = np.frombuffer(answer.body[:12], "<u4"), np.frombuffer(answer.body[12:], "<f8")
    assert [*head] == [2, 3, 0]
    np.testing.assert_array_equal(values, [0, 1, 2, 1, np.nan, 3])
    (folder / "broken.npz").write_bytes(b"PK\3\4 cut off")
    broken = waiting.page.get("/series/files/broken.npz")
    assert broken.status == 404
    assert b"has no series" in broken.body
    assert b"Traceback" not in broken.body
