"""What every torture test checks at its end: that no process of it is left."""

from __future__ import annotations

import contextlib
import uuid
from typing import TYPE_CHECKING

import psutil
import pytest

from harness import MARK, marked
from rtf import clock

if TYPE_CHECKING:
    from collections.abc import Iterator


def left_over(mark: str, others: set[psutil.Process], timeout: float = 5.0) -> list[str]:
    """The processes that carry the mark, or are below this one; given a moment to be gone.

    ``others`` are children of this one that are not meant, such as a browser that tests before have shared.
    """
    deadline = clock.Deadline.after(timeout)
    while True:
        found = {process.pid: process for process in (*marked(mark), *_below(others))}
        if not found or deadline.expired:
            return [_describe(process) for process in found.values()]
        clock.sleep(0.01)


def _below(others: set[psutil.Process]) -> list[psutil.Process]:
    found = []
    for child in set(psutil.Process().children()) - others:
        with contextlib.suppress(psutil.NoSuchProcess):  # it is gone by now
            found += [child, *child.children(recursive=True)]
    return [one for one in found if one.is_running() and one.status() != psutil.STATUS_ZOMBIE]


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
    others = set(psutil.Process().children())
    yield
    left = left_over(mark, others)
    assert left == []
