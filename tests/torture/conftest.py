"""The fixture of all torture tests, which checks at the end that no process is left."""

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
    """Return the processes with the mark or below this one, after giving them time to end.

    ``others`` are children of this process to ignore, such as a browser that earlier tests share.
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
    """Check after the test that neither a marked process nor a child of this one is left."""
    mark = uuid.uuid4().hex
    monkeypatch.setenv(MARK, mark)
    others = set(psutil.Process().children())
    yield
    left = left_over(mark, others)
    assert left == []
