"""A network for each test of robots, of which nothing is left afterwards, and a clock that tests advance."""

from __future__ import annotations

import threading
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from rtf import clock
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from waiting import eventually, open_descriptors

from .sensor_bench import ManualClock

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture
def said() -> list[str]:
    """The sentences that the network reported."""
    return []


@contextmanager
def nothing_left() -> Iterator[None]:
    """Check that the block leaves no thread and no descriptor."""
    threads = set(threading.enumerate())
    descriptors = open_descriptors()
    yield
    eventually(lambda: set(threading.enumerate()) <= threads, "a thread is left")
    eventually(lambda: open_descriptors() <= descriptors, "a descriptor is left")


@pytest.fixture
def network(said: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Network]:
    """A network of this process, of which nothing is left afterwards."""
    monkeypatch.setenv("YARP_RUNTIME_DIR", str(tmp_path / "runtime"))
    with nothing_left():
        yield Network(LocalNames(), patience=30, report=said.append)


@pytest.fixture(scope="class")
def shared_network(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Network]:
    """A network for all tests of a class, which restore the initial state of what they use."""
    with pytest.MonkeyPatch.context() as patch, nothing_left():
        patch.setenv("YARP_RUNTIME_DIR", str(tmp_path_factory.mktemp("runtime")))
        yield Network(LocalNames(), patience=30)


@pytest.fixture
def stepped() -> Iterator[ManualClock]:
    """The robot's clock, which the test advances."""
    with clock.use(ManualClock()) as time:
        assert isinstance(time, ManualClock)
        yield time


@pytest.fixture(scope="class")
def shared_time() -> Iterator[ManualClock]:
    """The robot's clock for all tests of a class; it is not reset between them."""
    with clock.use(ManualClock()) as time:
        assert isinstance(time, ManualClock)
        yield time
