"""The socket watcher: one thread reads many sockets, and an error in one does not affect others."""

from __future__ import annotations

import socket
import threading
from typing import TYPE_CHECKING

import pytest

from rtf.middleware.carriers.socket_watcher import SocketWatcher
from waiting import eventually, open_descriptors

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


@pytest.fixture
def watcher() -> Iterator[SocketWatcher]:
    """A watcher; it must leave no thread and no descriptor."""
    threads, descriptors = set(threading.enumerate()), open_descriptors()
    yield SocketWatcher("watcher")
    eventually(lambda: set(threading.enumerate()) <= threads, "a thread is left")
    assert open_descriptors() <= descriptors


class Ear:
    """A watched socket that keeps what it receives, and its peer."""

    def __init__(self, watcher: SocketWatcher) -> None:
        self.near, self.far = socket.socketpair()
        self.heard: list[bytes] = []
        self.came = threading.Event()
        self._watcher = watcher
        watcher.add(self.near, self._take)

    def _take(self) -> None:
        self.heard.append(self.near.recv(100))
        self.came.set()

    def hears(self) -> bool:
        """Return whether bytes that the peer sends now are received."""
        self.came.clear()
        self.far.send(b"hello")
        return self.came.wait(5)

    def close(self) -> None:
        """Remove the socket, and close both ends."""
        self._watcher.remove(self.near)
        self.near.close()
        self.far.close()


def test_all_that_were_added_are_heard_by_one_thread(watcher: SocketWatcher):
    """One thread reads all sockets, also those that are added while it waits."""
    before = threading.active_count()
    ears = [Ear(watcher) for _ in range(20)]
    assert all(ear.hears() for ear in ears)
    assert threading.active_count() == before + 1
    for ear in ears:
        ear.close()


def test_one_that_was_removed_is_not_heard_any_more(watcher: SocketWatcher):
    """A removed socket is not read any more, and others are."""
    ear, other = Ear(watcher), Ear(watcher)
    watcher.remove(ear.near)
    ear.far.send(b"hello")
    assert other.hears()
    assert ear.heard == []
    ear.close()
    other.close()


def test_a_watcher_that_was_idle_starts_anew(watcher: SocketWatcher):
    """Removing the last socket ends the thread, and adding one starts it again."""
    before = {*threading.enumerate()}
    for _ in range(50):
        ear = Ear(watcher)
        assert ear.hears()
        ear.close()
        assert before.issuperset(threading.enumerate())  # threads of tests before this one may end meanwhile


def test_sockets_that_come_and_go_at_the_same_time_are_all_heard(watcher: SocketWatcher):
    """Sockets that several threads add and remove are all read."""
    deaf: list[int] = []

    def come_and_go() -> None:
        for number in range(100):
            ear = Ear(watcher)
            if not ear.hears():
                deaf.append(number)
            ear.close()

    threads = [threading.Thread(target=come_and_go) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert deaf == []


def test_a_socket_that_was_closed_behind_its_back_makes_room_for_another(watcher: SocketWatcher):
    """A socket with the descriptor of a closed one is read, also after the closed one is removed."""
    keeper, old = Ear(watcher), Ear(watcher)
    number = old.near.fileno()
    old.near.close()
    new = Ear(watcher)
    assert new.near.fileno() == number
    assert new.hears()
    old.close()
    assert new.hears()
    new.close()
    keeper.close()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
@pytest.mark.parametrize("error", [ZeroDivisionError, SystemExit, KeyboardInterrupt])
def test_an_error_is_reported_and_the_others_go_on(
    watcher: SocketWatcher, monkeypatch: pytest.MonkeyPatch, error: type[BaseException]
):
    """An error of a callback reaches threading.excepthook, and other sockets are read."""
    reported: list[type[BaseException]] = []
    monkeypatch.setattr(threading, "excepthook", lambda args: reported.append(args.exc_type))
    broken, sound = socket.socketpair(), Ear(watcher)

    def fail() -> None:
        broken[0].recv(100)
        raise error

    watcher.add(broken[0], fail)
    broken[1].send(b"hello")
    eventually(lambda: reported == [error], "the error is not reported")
    assert sound.hears()
    watcher.remove(broken[0])
    for end in broken:
        end.close()
    sound.close()


def test_a_thread_that_cannot_be_started_is_started_later(watcher: SocketWatcher, monkeypatch: pytest.MonkeyPatch):
    """A moment without free threads is an error of that call only: the next one starts the thread."""
    near, far = socket.socketpair()

    def refuse(thread: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    with monkeypatch.context() as patch:
        patch.setattr(threading.Thread, "start", refuse)
        with pytest.raises(RuntimeError):
            watcher.add(near, lambda: None)
    ear = Ear(watcher)
    assert ear.hears()
    watcher.remove(near)
    ear.close()
    near.close()
    far.close()


def test_what_is_called_may_remove_its_own_socket(watcher: SocketWatcher):
    """A callback may remove its own socket, even the last one."""
    near, far = socket.socketpair()
    called: list[bool] = []

    def leave() -> None:
        watcher.remove(near)
        called.append(watcher.is_here)

    assert_called: Callable[[], bool] = lambda: called == [True]  # noqa: E731
    watcher.add(near, leave)
    far.send(b"hello")
    eventually(assert_called, "it was not called")
    assert not watcher.is_here
    near.close()
    far.close()
