"""The work queue: tasks run in order in a thread, a newer task replaces one of its key, and the number is limited."""

from __future__ import annotations

import threading
from functools import partial

import pytest

from rtf.middleware.errors import ConnectError
from rtf.middleware.naming import work_queue as module
from rtf.middleware.naming.work_queue import WorkQueue
from waiting import eventually


@pytest.fixture
def errands(nothing_left: None):
    """An empty queue; an error in a task fails the test."""
    failures: list[Exception] = []
    made = WorkQueue("errands", failures.append)
    yield made
    made.close()
    assert failures == []


class Gate:
    """A task that blocks the queue's thread until it is opened."""

    def __init__(self, errands: WorkQueue) -> None:
        self.reached, self.open = threading.Event(), threading.Event()
        errands.put("gate", self._wait)
        assert self.reached.wait(10)

    def _wait(self) -> None:
        self.reached.set()
        self.open.wait(10)


def finish(errands: WorkQueue) -> None:
    """Wait until all tasks are done."""
    done = threading.Event()
    errands.put("done", done.set)
    assert done.wait(10)


def test_in_order_and_the_newest_of_a_kind(errands: WorkQueue):
    """A waiting task is replaced by one of the same key, which takes the last place."""
    done: list[str] = []
    gate = Gate(errands)
    for key, text in ("a", "a1"), ("b", "b1"), ("a", "a2"), ("c", "c1"):
        errands.put(key, partial(done.append, text))
    errands.cancel("c")
    gate.open.set()
    finish(errands)
    assert done == ["b1", "a2"]


def test_bounded(errands: WorkQueue, monkeypatch: pytest.MonkeyPatch):
    """Beyond MAX_WAITING the oldest tasks are dropped."""
    monkeypatch.setattr(module, "MAX_WAITING", 3)
    done: list[int] = []
    gate = Gate(errands)
    for index in range(10):
        errands.put(index, partial(done.append, index))
    gate.open.set()
    while len(done) < 3:
        gate.open.wait(0.001)
    finish(errands)
    assert done == [7, 8, 9]


def test_an_error_is_reported_and_the_next_task_is_done():
    """An RtfError of a task is handed to the callback, and the next task runs."""
    failures: list[Exception] = []
    errands = WorkQueue("errands", failures.append)

    def fail() -> None:
        raise ConnectError("no")

    errands.put(1, fail)
    finish(errands)
    errands.close()
    assert [str(failure) for failure in failures] == ["no"]


def test_a_bug_is_reported_and_the_next_task_is_done(monkeypatch: pytest.MonkeyPatch):
    """Any other exception reaches threading.excepthook, and the next task runs in a new thread."""
    heard: list[type[BaseException]] = []
    ended = threading.Event()

    def hear(bug: threading.ExceptHookArgs) -> None:
        heard.append(bug.exc_type)
        ended.set()

    monkeypatch.setattr(threading, "excepthook", hear)
    errands = WorkQueue("errands", print)
    errands.put(1, lambda: 1 // 0)
    assert ended.wait(10)
    finish(errands)
    errands.close()
    assert heard == [ZeroDivisionError]


def test_nothing_after_the_end():
    """After closing, waiting and new tasks are not run, and closing again is possible."""
    done: list[int] = []
    errands = WorkQueue("errands", print)
    gate = Gate(errands)
    errands.put(1, partial(done.append, 1))
    closing = threading.Thread(target=errands.close)
    closing.start()
    eventually(lambda: not errands._open, "it is not being closed")
    gate.open.set()
    closing.join(10)
    errands.put(2, partial(done.append, 2))
    errands.close()
    assert done == []


def test_no_thread_for_nothing():
    """The thread starts with the first task."""
    before = threading.active_count()
    WorkQueue("errands", print).close()
    errands = WorkQueue("errands", print)
    assert threading.active_count() == before
    errands.close()
