"""What every torture test checks at its end: that no process of it is left."""

from __future__ import annotations

import uuid
from typing import TYPE_CHECKING

import psutil
import pytest

from harness import MARK, marked
from rtf import clock

if TYPE_CHECKING:
    from collections.abc import Iterator


def left_over(mark: str, timeout: float = 5.0) -> list[str]:
    """The processes that carry the mark, or are below this one; given a moment to be gone."""
    deadline = clock.Deadline.after(timeout)
    while True:
        found = {process.pid: process for process in (*marked(mark), *_below())}
        if not found or deadline.expired:
            return [_describe(process) for process in found.values()]
        clock.sleep(0.01)


def _below() -> list[psutil.Process]:
    children = psutil.Process().children(recursive=True)
    return [child for child in children if child.is_running() and child.status() != psutil.STATUS_ZOMBIE]


def _describe(process: psutil.Process) -> str:
    try:
        return f"{process.pid} {process.status()} {' '.join(process.cmdline())[:200]}"
    except psutil.NoSuchProcess:
        return f"{process.pid} is just gone"


@pytest.fixture
def no_process_left(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """After the test, neither a marked process nor a child of this one is there."""
    mark = uuid.uuid4().hex
    monkeypatch.setenv(MARK, mark)
    yield
    left = left_over(mark)
    assert left == []
