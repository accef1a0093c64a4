"""``rtf app page`` as a user calls it: what it has started ends with it, however it ends."""

from __future__ import annotations

import os
import re
import signal
from typing import TYPE_CHECKING, Any

import pytest

from lab import module
from live_page import Page
from rtf.testing.isolation.processes import children_of
from waiting import alive, eventually

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Net, Tool


class Served:
    """A page as a process, with a module here and one on a node."""

    def __init__(self, net: Net, folder: Path) -> None:
        (folder / "lab.xml").write_text(
            f"<application><name>lab</name>{module('sleep', '60')}{module('sleep', '61', node='node1')}</application>"
        )
        words = ("app", "page", str(folder / "lab.xml"), "--web-port", "0")
        self.tool = net.start(*words, XDG_STATE_HOME=str(folder / "state"))
        self.tool.until(lambda: "web page: http" in self.tool.stdout, "the address")
        self.page = Page.said(self.tool.stdout)

    def post(self, word: str) -> int:
        """Send a request about all modules; returns the status of the answer."""
        headers = {"Content_Type": "application/json", "Authorization": f"Bearer {self.page.token}"}
        return self.page.ask("POST", f"/applications/0/{word}", b"{}", **headers).status

    def modules(self) -> dict[str, Any]:
        """The states of the modules, by tag."""
        found: dict[str, Any] = self.page.get("/applications/0/status").json["modules"]
        return found

    def start(self) -> list[int]:
        """Start all modules, and return their processes."""
        assert self.post("run") == 202
        eventually(lambda: [one[0] for one in self.modules().values()] == ["running"] * 2, "they do not run")
        return [one[1] for one in self.modules().values()]


@pytest.fixture
def node(net: Net) -> Tool:
    """A node as a process."""
    tool = net.start("run", "--server", "/node1", "--grace", "2")
    tool.until(lambda: "is available" in tool.stdout, "the node")
    return tool


@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGKILL])
def test_what_it_has_started_ends_with_it(net: Net, node: Tool, tmp_path: Path, signum: int):
    """Here and on nodes: at Ctrl-C the page stops it, and its keeper when the page is killed."""
    served = Served(net, tmp_path)
    pids = served.start()
    assert all(map(alive, pids))
    if signum == signal.SIGINT:
        assert served.tool.end(signal.SIGINT) == 0
    else:
        (page,) = children_of(served.tool.process.pid)
        os.kill(page, signal.SIGKILL)
        assert served.tool.wait() == 1
        assert net.run("clean").process.returncode == 0  # a killed program may leave the name of a port
    assert not any(map(alive, pids))
    node.end()


def test_a_file_that_is_not_there(net: Net, tmp_path: Path):
    """It is an error, unless a new application is to be begun."""
    words = ("app", "page", str(tmp_path / "a&b.xml"), "--web-port", "0")
    tool = net.run(*words)
    assert tool.process.returncode == 1
    assert re.search(r"there is no application \S+a&b.xml; --new begins an empty one", tool.stderr)
    tool = net.start(*words, "--new")
    tool.until(lambda: "web page: http" in tool.stdout, "the address")
    assert tool.end() == 0
    assert "<name>a&amp;b</name>" in (tmp_path / "a&b.xml").read_text()
