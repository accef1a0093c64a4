"""A network for each test; it must leave no thread and no descriptor."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from waiting import eventually, open_descriptors

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture
def said() -> list[str]:
    """The reports of the network."""
    return []


@pytest.fixture
def network(said: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Network]:
    """A network of this process; it must leave no thread and no descriptor."""
    monkeypatch.setenv("YARP_RUNTIME_DIR", str(tmp_path / "runtime"))
    threads = set(threading.enumerate())
    descriptors = open_descriptors()
    yield Network(LocalNames(), report=said.append)
    eventually(lambda: set(threading.enumerate()) <= threads, "a thread is left")
    eventually(lambda: open_descriptors() <= descriptors, "a descriptor is left")
