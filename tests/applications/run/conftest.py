"""A node in this process, shared by the tests of a file."""

from __future__ import annotations

import shutil
import threading
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import pytest

from rtf.applications.run.client import RunClient
from rtf.applications.run.server import RunServer
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from waiting import eventually, open_descriptors

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from rtf.applications.run.children import Child


@dataclass
class Node:
    """A node, a client of it, and what it said."""

    network: Network
    server: RunServer
    client: RunClient
    said: list[str] = field(default_factory=list)

    def child(self, pid: int) -> Child:
        """What the node knows of a program."""
        return next(one for one in self.server._children.running() if one.pid == pid)

    def said_of(self, tag: str) -> str:
        """What it said at the end of a program, when it has."""
        eventually(lambda: not self.client.is_running(tag), f"{tag} still runs")
        return next(line for line in reversed(self.said) if line.startswith(f"{tag} ("))


@pytest.fixture(scope="module")
def _node() -> Iterator[Node]:
    threads, descriptors = set(threading.enumerate()), open_descriptors()
    said: list[str] = []
    network = Network(LocalNames(), report=said.append)
    with RunServer("/node1", network=network, said=said.append, grace=0.3) as server:
        yield Node(network, server, RunClient("/node1", network=network), said)
    eventually(lambda: set(threading.enumerate()) <= threads, "a thread is left")
    eventually(lambda: open_descriptors() <= descriptors, "a descriptor is left")


@pytest.fixture
def node(_node: Node) -> Iterator[Node]:
    """The node; afterwards no program of the test runs any more."""
    _node.said.clear()
    yield _node
    for row in _node.client.running():
        _node.client.kill(row.tag, 9)
    eventually(lambda: not _node.client.running(), "a program is left")


@pytest.fixture
def no_window(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A PATH with ``cat``, and without a program that opens windows."""
    found = shutil.which("cat")
    assert found is not None
    (tmp_path / "cat").symlink_to(found)
    monkeypatch.setenv("PATH", str(tmp_path))
