"""One thread for many sockets: what is added is heard, what is removed is not, and what breaks breaks alone."""

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
    """A watcher of whose thread and descriptors nothing may be left."""
    threads, descriptors = set(threading.enumerate()), open_descriptors()
    yield SocketWatcher("watcher")
    eventually(lambda: set(threading.enumerate()) <= threads, "a thread is left")
    assert open_descriptors() <= descriptors


class Ear:
    """A socket whose messages are kept, and the other end of it."""

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
        """Whether what is said now is heard."""
        self.came.clear()
        self.far.send(b"hello")
        return self.came.wait(5)

    def close(self) -> None:
        """Be done."""
        self._watcher.remove(self.near)
        self.near.close()
        self.far.close()


def test_all_that_were_added_are_heard_by_one_thread(watcher: SocketWatcher):
    """Also those that came while the thread was waiting already."""
    before = threading.active_count()
    ears = [Ear(watcher) for _ in range(20)]
    assert all(ear.hears() for ear in ears)
    assert threading.active_count() == before + 1
    for ear in ears:
        ear.close()


def test_one_that_was_removed_is_not_heard_any_more(watcher: SocketWatcher):
    """The others are."""
    ear, other = Ear(watcher), Ear(watcher)
    watcher.remove(ear.near)
    ear.far.send(b"hello")
    assert other.hears()
    assert ear.heard == []
    ear.close()
    other.close()


def test_a_watcher_that_was_idle_starts_anew(watcher: SocketWatcher):
    """Its thread ends with the last socket and comes back with the next; whoever removed the last one sees it ended."""
    before = threading.active_count()
    for _ in range(50):
        ear = Ear(watcher)
        assert ear.hears()
        ear.close()
        assert threading.active_count() == before


def test_sockets_that_come_and_go_at_the_same_time_are_all_heard(watcher: SocketWatcher):
    """Whatever the order in which the thread ends and is wanted again."""
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
    """The kernel gives its number to the next one, which is heard; to remove the old one changes nothing."""
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
def test_an_error_is_told_and_the_others_go_on(watcher: SocketWatcher, monkeypatch: pytest.MonkeyPatch):
    """As an error of a thread is reported."""
    told: list[type[BaseException]] = []
    monkeypatch.setattr(threading, "excepthook", lambda args: told.append(args.exc_type))
    broken, sound = socket.socketpair(), Ear(watcher)

    def fail() -> None:
        broken[0].recv(100)
        raise ZeroDivisionError

    watcher.add(broken[0], fail)
    broken[1].send(b"hello")
    eventually(lambda: told == [ZeroDivisionError], "the error is not told")
    assert sound.hears()
    watcher.remove(broken[0])
    for end in broken:
        end.close()
    sound.close()


def test_what_is_called_may_remove_its_own_socket(watcher: SocketWatcher):
    """Even if it is the last one."""
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
