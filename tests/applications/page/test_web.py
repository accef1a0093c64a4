"""The server of the page of applications: what it shows, what needs the token, and what it refuses."""

from __future__ import annotations

import json
from contextlib import closing
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import pytest

from lab import LabFactory
from live_page import Page
from rtf.applications.page.control import ControlledApplication
from rtf.applications.page.web import MAX_BODY, serve_applications
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from live_page import Answer

TOKEN = "the-token"
DESCRIPTION = """<module><name>camera</name><description>Sends pictures.</description>
<arguments><param default="/camera">name</param><param required="yes" desc="a second">rate</param></arguments>
<data><output><type>Image</type><port>/camera/out</port></output>
<input><type>Bottle</type><port>/camera/in</port><required>yes</required></input></data></module>"""
LAB = """<application><name>lab</name>
<module><name>camera</name><parameters>--name /left</parameters></module>
<module><name>sleep</name><parameters>60</parameters></module>
<application><name>inner.xml</name></application>
<connection><from>/left/out</from><to>/view/in</to></connection></application>"""
INNER = (
    """<application><name>inner</name><module><name>view</name><parameters>/view</parameters></module></application>"""
)


class Client(Page):
    """A browser that knows the token."""

    def post(self, path: str, body: object, **headers: str) -> Answer:
        """Send a request with the token."""
        given = {"Content_Type": "application/json", "Authorization": f"Bearer {TOKEN}", **headers}
        data = body if isinstance(body, bytes) else json.dumps(body).encode()
        return self.ask("POST", f"/applications/0/{path}", data, **given)

    def document(self) -> Any:
        """Return the document and the view of the file."""
        return self.get("/applications/0/document").json


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with an application and the description of a program."""
    made = tmp_path_factory.mktemp("lab")
    (made / "modules").mkdir()
    (made / "modules" / "camera.xml").write_text(DESCRIPTION)
    (made / "modules" / "broken.xml").write_text("<module>")
    (made / "inner.xml").write_text(INNER)
    return made


@pytest.fixture(scope="module")
def client(folder: Path) -> Iterator[Client]:
    """The page of the application."""
    (folder / "lab.xml").write_text(LAB)
    with (
        closing(ControlledApplication(folder / "lab.xml", {}, LabFactory(folder))) as controlled,
        serve_applications([controlled], "127.0.0.1", 0, TOKEN) as address,
    ):
        place = urlsplit(address)
        assert place.fragment == f"token={TOKEN}"
        yield Client("127.0.0.1", place.port or 0)


def test_the_page_and_its_facts(client: Client, folder: Path):
    """The page, its modules, and the files of the applications, for everybody on this machine."""
    index = client.get("/")
    assert index.headers["content-type"] == "text/html; charset=utf-8"
    assert b"applications.js" in index.body
    assert "script-src 'self'" in index.headers["content-security-policy"]
    assert client.get("/apps_graph.js").status == 200
    assert client.get("/facts").json == {"mode": "applications", "files": [str(folder / "lab.xml")]}


def test_view_has_ports_of_descriptions_and_embedded_modules(client: Client):
    """A port has the name that the parameters give it; what is embedded has no id, and problems have their place."""
    view = client.document()["view"]
    camera, sleep, inner = view["modules"]
    assert [(port["name"], port["kind"], port["required"]) for port in camera["ports"]] == [
        ("/left/in", "input", True),
        ("/left/out", "output", False),
    ]
    assert sleep["ports"] == []
    assert (inner["id"], inner["file"]) == ("", "inner.xml")
    assert [(port["name"], port["described"]) for port in inner["ports"]] == [("/view/in", False)]
    of_camera = [one["text"] for one in view["problems"] if one["id"] == camera["id"]]
    assert "camera needs the argument --rate" in of_camera
    assert "nothing is connected to /left/in, which camera requires" in of_camera


def test_palette_has_the_described_programs(client: Client):
    """With their arguments and ports; a broken description is left out."""
    (program,) = client.get("/applications/0/palette").json
    assert (program["name"], program["description"]) == ("camera", "Sends pictures.")
    assert [one["name"] for one in program["arguments"]] == ["name", "rate"]


def test_changes_are_checked_and_saved(client: Client, folder: Path):
    """A check writes nothing; its problems are those of the changed application, at the ids of the page."""
    document = client.document()["document"]
    document["connections"].append({"id": "n1", "source": "/left/out", "target": "/view/in", "protocol": "fast_tpc"})
    document["modules"][0] |= {"parameters": "--name /left --rate 30", "x": 10, "y": 20}
    view = client.post("check", document).json["view"]
    (problem,) = [one for one in view["problems"] if "fast_tpc" in one["text"]]
    assert (problem["id"], problem["severity"]) == ("n1", "error")
    assert not [one for one in view["problems"] if "--rate" in one["text"]]
    assert (folder / "lab.xml").read_text() == LAB
    saved = client.post("save", document)
    assert saved.json["document"]["modules"][0]["x"] == 10
    assert "<geometry>(Pos (x 10.0) (y 20.0))</geometry>" in (folder / "lab.xml").read_text()
    again = client.post("save", document)
    assert (again.status, "changed by another program" in again.json["error"]) == (409, True)
    (folder / "lab.xml").write_text(LAB)


def test_requests_start_and_stop(client: Client):
    """They are accepted at once; the status says what comes of them."""
    assert client.post("run", {"modules": ["sleep600"]}).status == 202

    def state() -> str:
        found: str = client.get("/applications/0/status").json["modules"].get("sleep600", ["none"])[0]
        return found

    eventually(lambda: state() == "running", "it does not run")
    assert client.get("/applications/0/output?module=sleep600").json == []
    assert client.post("stop", {}).status == 202
    eventually(lambda: state() == "stopped", "it is not stopped")

    def happened(after: str = "") -> list[dict[str, object]]:
        found: list[dict[str, object]] = client.get(f"/applications/0/status{after}").json["happened"]
        return found

    eventually(lambda: happened()[-1]["kind"] == "stopped", "its end is not among what happened")  # after the state
    assert happened(f"?after={happened()[-1]['number']}") == []


@pytest.mark.parametrize("word", ["run", "stop", "kill", "connect", "disconnect", "check", "save", "rate"])
def test_what_changes_or_asks_needs_the_token(client: Client, word: str):
    """Without it, or from another site, nothing is done."""
    assert client.post(word, {}, Authorization="Bearer other").status == 401
    assert client.post(word, {}, Origin="http://example.com").status == 403
    assert client.post(word, {}, Content_Type="text/plain").status == 415
    assert client.get(f"/applications/0/{word}").status == 405


@pytest.mark.parametrize(
    ("path", "body", "status"),
    [
        *((word, body, 400) for word in ("run", "check") for body in (b"", b"[]", b"[" * 50_000, b'{"x": 1}', b"\xff")),
        ("run", {"modules": [1]}, 400),
        ("run", {"modules": ["no such module"]}, 400),
        ("save", b" " * (MAX_BODY + 1), 413),
        ("check", {"revision": "other"}, 409),
        ("../9/run", {}, 404),
    ],
)
def test_bad_requests_are_refused(client: Client, path: str, body: object, status: int):
    """Each with a reason."""
    answer = client.post(path, body) if ".." not in path else client.ask("POST", "/applications/9/run")
    assert answer.status == status
    assert "error" in answer.json


def test_a_file_that_cannot_be_read_is_reported(client: Client, folder: Path):
    """With its place; the page stays."""
    (folder / "lab.xml").write_text("<application>\n<module></application>")
    answer = client.get("/applications/0/document")
    assert (answer.status, ":2:" in answer.json["error"]) == (422, True)
    (folder / "lab.xml").write_text(LAB)
