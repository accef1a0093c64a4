"""Applications on the page: run, stopped, connected and saved by requests, and left to others in between."""

from __future__ import annotations

import subprocess
import threading
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING, Any

import msgspec
import pytest

from lab import LabFactory, module, needs, shell
from rtf.applications.deployer import DeployerContext
from rtf.applications.errors import ApplicationError
from rtf.applications.events import Kind
from rtf.applications.links import Links
from rtf.applications.manager import Manager
from rtf.applications.page.control import ControlledApplication
from rtf.applications.page.document import read_document
from rtf.applications.run.client import RunClient
from rtf.applications.run.protocol import Start
from rtf.applications.run.server import RunServer
from rtf.applications.session import Session
from rtf.applications.xml.reader import read_application
from rtf.middleware.ports import remote
from rtf.middleware.ports.buffered import BufferedPort
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from rtf.applications.connections import Link
    from rtf.applications.events import Say
    from rtf.applications.xml.model import Application, Connection
    from rtf.middleware.ports.remote import Ask

CONNECTION = "<connection><from>/a</from><to>/b</to></connection>"


class Bench:
    """An application on the page, and the network on which it runs."""

    def __init__(self, folder: Path, content: str) -> None:
        self.path = folder / "lab.xml"
        self.path.write_text(f"<application><name>lab</name>{content}</application>")
        self.factory = LabFactory(folder)
        self.controlled = ControlledApplication(self.path, {}, self.factory)

    def states(self) -> dict[str, str]:
        """The states of the modules, by tag."""
        return {tag: state for tag, (state, *_) in self.controlled.status().modules.items()}

    def has(self, **states: str) -> None:
        """Wait until modules have these states."""
        eventually(lambda: self.states() == states, f"they are not {states}")

    def texts(self, kind: Kind) -> list[str]:
        """What happened of a kind."""
        return [one.text for one in self.controlled.status().happened if one.kind == kind]


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Callable[[str], Bench]]:
    """Puts an application of this content on the page; afterwards it is stopped."""
    made: list[Bench] = []

    def make(content: str) -> Bench:
        made.append(Bench(tmp_path, content))
        return made[-1]

    yield make
    for one in made:
        one.controlled.close()


def test_modules_are_run_and_stopped(bench: Callable[[str], Bench], tmp_path: Path):
    """One, several or all; the session is held only while something runs."""
    lab = bench(module("sleep", "60") + module("sleep", "61") + shell(tmp_path, "fail", "echo no camera; exit 3"))
    session = tmp_path / "lab.session"
    lab.controlled.run(None)
    lab.has(**{"sleep600": "running", "sleep610": "running", "shfail.sh0": "failed"})
    assert [*lab.controlled.output("shfail.sh0")] == ["no camera"]
    assert lab.controlled.status().modules["shfail.sh0"][2] == "exit status 3"
    assert session.read_text()
    lab.controlled.stop({"sleep600"})
    lab.has(**{"sleep600": "stopped", "sleep610": "running", "shfail.sh0": "failed"})
    lab.controlled.run({"sleep600"})
    lab.has(**{"sleep600": "running", "sleep610": "running", "shfail.sh0": "failed"})
    lab.controlled.stop(None, kill=True)
    lab.has(**dict.fromkeys(("sleep600", "sleep610", "shfail.sh0"), "stopped"))
    eventually(lambda: session.read_text() == "", "the session is still held")
    assert "sleep 61 is killed" in lab.texts(Kind.STOPPED)


def test_what_others_have_started_is_found_and_left(bench: Callable[[str], Bench]):
    """When the page ends it stops only what it has started itself."""
    lab = bench(module("sleep", "60", node="pc1") + module("sleep", "61", node="pc1"))
    lab.controlled.close()
    with RunServer("/pc1", network=lab.factory.network):
        loaded = read_application(lab.path)
        client = RunClient("/pc1", network=lab.factory.network)
        client.start(Start(loaded.application.modules[0].tag, "sleep 60"))
        lab.controlled = ControlledApplication(lab.path, {}, lab.factory)
        lab.has(**{":pc1sleep600": "running", ":pc1sleep610": "stopped"})
        lab.controlled.run({":pc1sleep610"})
        lab.has(**{":pc1sleep600": "running", ":pc1sleep610": "running"})
        lab.controlled.close()
        assert [row.tag for row in client.running()] == [":pc1sleep600"]


def test_a_waiting_module_can_be_stopped(bench: Callable[[str], Bench]):
    """It is no failure that it did not get its port."""
    lab = bench(module("sleep", "60", needs("/never")))
    lab.controlled.run(None)
    lab.has(sleep600="waiting")
    lab.controlled.stop(None)
    lab.has(sleep600="stopped")
    assert lab.texts(Kind.FAILED) == []


def test_connections_are_made_and_ended(bench: Callable[[str], Bench]):
    """Whether something runs or not; ports that are not open are apart."""
    lab = bench(CONNECTION)
    eventually(lambda: lab.controlled.status().connections == {"/a /b": "no port"}, "it is not looked at")
    network = lab.factory.network
    with BufferedPort("/a", network=network), BufferedPort("/b", network=network):
        lab.controlled.connect(None)
        eventually(lambda: lab.controlled.status().connections == {"/a /b": "connected"}, "it is not connected")
        assert lab.controlled.rate("/a /b").messages == 0
        lab.controlled.disconnect({"/a /b"})
        eventually(lambda: lab.controlled.status().connections == {"/a /b": "apart"}, "it is still connected")


def test_loads_of_nodes_are_shown(bench: Callable[[str], Bench]):
    """Those of this machine, of a node, and why one does not answer."""
    lab = bench(module("sleep", "60") + module("sleep", "61", node="pc1") + module("sleep", "62", node="gone"))
    with RunServer("/pc1", network=lab.factory.network):
        eventually(lambda: len(lab.controlled.status().nodes) == 3, "they are not asked")
        nodes = lab.controlled.status().nodes
        assert nodes["localhost"]["cores"] == nodes["pc1"]["cores"]
        assert "there is no node /gone" in str(nodes["gone"]["error"])


def test_saved_changes_are_used_when_all_is_stopped(bench: Callable[[str], Bench]):
    """What runs is not changed by a save, and cannot be mixed with what is in the file now."""
    lab = bench(module("sleep", "60"))
    lab.controlled.run(None)
    lab.has(sleep600="running")
    document, _ = read_document(lab.path)
    changed = msgspec.structs.replace(document.modules[0], parameters="70")
    lab.controlled.save(msgspec.structs.replace(document, modules=(changed,)))
    assert lab.controlled.status().outdated
    with pytest.raises(ApplicationError, match="still runs as it was before it was saved; stop it first"):
        lab.controlled.run(None)
    lab.controlled.stop(None)
    eventually(lambda: not lab.controlled.status().outdated, "the file is not read again")
    lab.controlled.run(None)
    lab.has(sleep700="running")
    lab.controlled.stop(None)
    lab.has(sleep700="stopped")
    document, _ = read_document(lab.path)
    lab.controlled.save(msgspec.structs.replace(document, modules=()))
    lab.controlled.run(None)


class HesitantManager(Manager):
    """Before it looks the first time, it gives others half a second to close it."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.looks = threading.Event()
        self.is_closed = threading.Event()

    def watch_once(self) -> None:
        """Look, after a while."""
        self.looks.set()
        self.is_closed.wait(0.5)
        super().watch_once()

    def close(self) -> None:
        """Close."""
        super().close()
        self.is_closed.set()


class HesitantFactory(LabFactory):
    """Its first manager is hesitant."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.first: HesitantManager | None = None

    def manager(self, application: Application, said: Say, *, attached: bool = False) -> Manager:
        """Make it."""
        if self.first is not None:
            return super().manager(application, said, attached=attached)
        self.first = HesitantManager(application, DeployerContext(self.network, self.network, "/app/page"), said)
        return self.first


def test_a_manager_is_not_ended_while_it_is_looking(tmp_path: Path):
    """A run that comes after a save, while a manager looks for what was left, waits for its look."""
    path = tmp_path / "lab.xml"
    path.write_text(f"<application><name>lab</name>{module('sleep', '60')}</application>")
    factory = HesitantFactory(tmp_path)
    with closing(ControlledApplication(path, {}, factory)) as controlled:
        eventually(lambda: factory.first is not None and factory.first.looks.is_set(), "nothing is looked for")
        document, _ = read_document(path)
        changed = msgspec.structs.replace(document.modules[0], parameters="70")
        controlled.save(msgspec.structs.replace(document, modules=(changed,)))
        controlled.run(None)
        eventually(lambda: controlled.status().modules["sleep700"][0] == "running", "it does not run")
        controlled.stop(None)
        eventually(lambda: controlled.status().modules["sleep700"][0] == "stopped", "it is not stopped")


def test_an_application_of_another_process_is_watched(bench: Callable[[str], Bench], tmp_path: Path):
    """Its modules cannot be started here, nor be stopped one by one."""
    with Session(tmp_path / "lab.session"):
        lab = bench(module("sleep", "60"))
        eventually(lambda: lab.controlled.status().runner, "the other process is not seen")
        with pytest.raises(ApplicationError, match=r"process \d+ runs the application; stop it first"):
            lab.controlled.run(None)
        with pytest.raises(ApplicationError, match="can be stopped only whole"):
            lab.controlled.stop({"sleep600"})
    eventually(lambda: not lab.controlled.status().runner, "the other process is still seen")


def test_an_application_whose_process_has_just_gone_is_stopped(
    bench: Callable[[str], Bench], monkeypatch: pytest.MonkeyPatch
):
    """There is nothing to do, whatever the last look at it has said."""
    gone = subprocess.Popen(["true"])
    gone.wait()
    monkeypatch.setattr(LabFactory, "holder", lambda *_: gone.pid)
    lab = bench(module("sleep", "60"))
    eventually(lambda: lab.controlled.status().runner == gone.pid, "the other process is not seen")
    lab.controlled.stop(None)
    lab.controlled.stop(None, kill=True)


def test_errors_of_the_network_do_not_end_the_looks_at_it(
    bench: Callable[[str], Bench], monkeypatch: pytest.MonkeyPatch
):
    """They are told, and connections are looked at again."""
    states, errors = Links.states, [ApplicationError("the network is upset")]

    def upset_first(links: Links) -> list[tuple[Connection, Link]]:
        if errors and threading.current_thread().name.endswith("(_watch_network)"):  # a manager looks, too
            raise errors.pop()
        return states(links)

    monkeypatch.setattr(Links, "states", upset_first)
    lab = bench(CONNECTION)
    eventually(lambda: lab.controlled.status().connections == {"/a /b": "no port"}, "it is not looked at", 3.0)
    assert lab.texts(Kind.FAILED) == ["the network is upset"]


def test_a_port_whose_answers_cannot_be_read_is_unknown(bench: Callable[[str], Bench], monkeypatch: pytest.MonkeyPatch):
    """Its connections are looked at until it answers well."""

    @contextmanager
    def confused(*_args: object, **_more: object) -> Iterator[Ask]:
        yield lambda *_: ["(" * 200]

    lab = bench(CONNECTION)
    network = lab.factory.network
    with BufferedPort("/a", network=network), BufferedPort("/b", network=network):
        with monkeypatch.context() as patch:
            patch.setattr(remote, "talk", confused)
            eventually(lambda: lab.controlled.status().connections == {"/a /b": "unknown"}, "it is not looked at", 3.0)
        eventually(lambda: lab.controlled.status().connections == {"/a /b": "apart"}, "it is not looked at again", 3.0)


@pytest.mark.parametrize(
    ("content", "message"),
    [("<module/>", "the application has errors; its problems say which"), ("", "has no such module; reload the page")],
)
def test_what_cannot_be_run_is_refused(bench: Callable[[str], Bench], content: str, message: str):
    """With the reason; nothing is started."""
    with pytest.raises(ApplicationError, match=message):
        bench(content).controlled.run({"other"})


def test_module_whose_node_is_chosen(bench: Callable[[str], Bench]):
    """The page knows it by its tag in the file, and has the node on which it runs, and the loads of all of them."""
    lab = bench(module("sleep", "60", node="pc1, gone"))
    with RunServer("/pc1", network=lab.factory.network):
        (tag,) = (one.tag for one in read_application(lab.path).application.modules)
        lab.controlled.run({tag})
        lab.has(**{tag: "running"})
        assert lab.controlled.status().modules[tag][3] == "pc1"
        eventually(lambda: {"pc1", "gone"} <= {*lab.controlled.status().nodes}, "the nodes are not asked")
        lab.controlled.stop(None)
        lab.has(**{tag: "stopped"})
