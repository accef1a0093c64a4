"""The supervisor: a robot stops when the process of a test dies or hangs, and what presses is released for it."""

from __future__ import annotations

import errno
import fcntl
import os
import signal
import subprocess
import sys
import threading
from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest

from rtf import clock
from rtf.bottle import Property
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.boards.client import connect
from rtf.robot.boards.server import ControlBoardServer
from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.errors import NoAnswerError, StaleStateError
from rtf.robot.publishing import PeriodicPublishing
from rtf.robot_testing.guard import supervisor
from rtf.robot_testing.guard.heartbeat import Heard, Heartbeat, heartbeats
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.guard.motion_guard import MotionGuard
from rtf.robot_testing.guard.supervisor import SILENCE, Supervisor
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

#: A test that watches, as long as it lives.
WATCHES = """
import sys
from rtf import clock
from rtf.robot_testing.guard.heartbeat import Heartbeat
beating = Heartbeat("fake")
while True:
    beating.beat()
    print(flush=True)
    clock.sleep(0.02)
"""


class Robot:
    """A board on a long move in the machine's time, the guard of the fixture, and its supervisor, which is asked."""

    def __init__(self, stack: ExitStack, folder: Path) -> None:
        network = Network(LocalNames())
        self.folder = folder
        device = FakeBoard("fake", network=network)
        device.open(Property.parse("(GENERAL (Joints 3))"))
        stack.callback(device.close)
        server = ControlBoardServer(device, "/fake", network=network)
        stack.callback(server.close)
        stack.callback(PeriodicPublishing(server, name="states", report=print).stop)
        self.board = stack.enter_context(connect("/fake", network=network, timeout=10.0))
        eventually(self._has_state, "no state arrives")
        self.said: list[str] = []
        self.may_move = True
        self.guard = MotionGuard(self.board, "/fake", clock=clock.SystemClock(), report=self.said.append)
        self.supervisor = Supervisor(
            "fake", [self.guard], using=threading.Lock(), may_move=lambda: self.may_move, report=self.said.append
        )
        stack.callback(self.supervisor.close)
        self.board.set_reference_speeds([1.0] * 3)
        self.board.position_move([90.0] * 3)

    def _has_state(self) -> bool:
        try:
            return bool(self.board.encoders().size)
        except StaleStateError:
            return False

    def stops(self) -> None:
        """Wait for the end of the move."""
        eventually(self.board.motion_done, "it goes on")


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Robot]:
    """The robot, in the folder of a run."""
    monkeypatch.setenv("RTF_RUN_FOLDER", str(tmp_path))
    with ExitStack() as stack:
        yield Robot(stack, tmp_path)


@pytest.fixture
def watching(robot: Robot) -> Iterator[subprocess.Popen[str]]:
    """A test that watches, in a process of its own."""
    assert robot.folder
    process = subprocess.Popen([sys.executable, "-c", WATCHES], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    process.stdout.readline()
    yield process
    process.kill()
    process.wait()
    process.stdout.close()


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGSTOP])
def test_a_test_that_is_killed_or_stopped_leaves_the_robot_stopped(
    robot: Robot, watching: subprocess.Popen[str], end: signal.Signals
):
    """In the middle of a move that would take a minute and a half; once, with a report. The benchmark has the times."""
    os.kill(watching.pid, end)
    robot.stops()
    why = "did not watch" if end is signal.SIGSTOP else "has died"
    eventually(lambda: robot.said, "it is not reported")
    assert [why in line for line in robot.said] == [True]
    assert "joint0, joint1, joint2 stopped" in robot.said[0]


def test_a_test_that_watches_again_is_notified(robot: Robot):
    """Once: its joints did not fail, they were stopped. Before it begins to watch, nothing is expected of it."""
    beating = Heartbeat("fake")
    assert [heard.silence() for heard in heartbeats(robot.folder, "fake")] == [0.0]
    assert beating.beat() == ""
    robot.stops()
    deadline = clock.Deadline.after(10.0)
    while not (answer := beating.beat()):
        assert not deadline.expired
    assert answer == f"the robot was stopped: the guard of the test did not watch for {SILENCE:g} s"
    assert beating.beat() == ""
    beating.close()


def test_a_guard_that_was_stopped_for_fails_its_test(robot: Robot):
    """Its next check raises the reason, as for any other stop."""
    beating = Heartbeat("fake")
    guard = MotionGuard(robot.board, "/fake", clock=clock.SystemClock(), report=print, heartbeat=beating)
    guard.watch()
    robot.stops()

    def watch_on() -> None:
        deadline = clock.Deadline.after(10.0)
        while not deadline.expired:
            guard.watch()

    with pytest.raises(GuardError, match="the robot was stopped: the guard of the test did not watch"):
        watch_on()
    beating.close()


def test_a_test_that_has_ended_properly_stops_nothing(robot: Robot):
    """What goes on then was restored by its guard."""
    robot.supervisor.close()  # which looks now, and not while this thread is late
    beating = Heartbeat("fake")
    beating.beat()
    beating.close()
    robot.supervisor.check()
    assert list(heartbeats(robot.folder, "fake")) == []
    assert not robot.board.motion_done()


def test_a_robot_that_may_not_move_is_left_alone(robot: Robot, request: pytest.FixtureRequest):
    """No command is sent to a real robot without permission."""
    robot.may_move = False
    watching: subprocess.Popen[str] = request.getfixturevalue("watching")
    watching.kill()
    watching.wait()
    robot.supervisor.check()
    assert robot.board.control_modes() == (ControlMode.POSITION,) * 3
    assert not robot.board.motion_done()
    assert robot.said == []


def test_a_test_of_another_robot_is_no_matter(robot: Robot, watching: subprocess.Popen[str]):
    """A run may have several robots: each has a supervisor, which must find the heartbeats of its own tests."""
    other = Supervisor("other", [], using=threading.Lock(), may_move=lambda: True, report=robot.said.append)
    watching.kill()
    watching.wait()
    other.check()
    other.close()
    robot.stops()
    eventually(lambda: robot.said, "it is not reported")


def test_a_heartbeat_that_begins_is_never_an_orphan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Its file appears with its lock: who looks just before it is locked sees no file."""
    monkeypatch.setenv("RTF_RUN_FOLDER", str(tmp_path))
    lock = fcntl.flock
    looks: list[list[bool]] = []

    def look() -> None:
        looks.append([heard.is_orphaned() for heard in heartbeats(tmp_path, "fake")])

    def lock_late(file: int, how: int) -> None:
        if how == fcntl.LOCK_EX and not looks:
            look()
        lock(file, how)

    monkeypatch.setattr(fcntl, "flock", lock_late)
    beating = Heartbeat("fake")
    look()
    beating.close()
    assert looks == [[], [False]]


def test_a_look_that_fails_is_reported_once_and_the_next_one_counts(robot: Robot, monkeypatch: pytest.MonkeyPatch):
    """As when the process has no descriptor left for a moment: a test that hangs then is stopped all the same."""
    failures = [OSError(errno.EMFILE, "Too many open files") for _ in range(3)]

    def fail_first(folder: str, name: str) -> Iterator[Heard]:
        if failures:
            raise failures.pop()
        return heartbeats(folder, name)

    monkeypatch.setattr(supervisor, "heartbeats", fail_first)
    beating = Heartbeat("fake")
    beating.beat()
    robot.stops()
    eventually(lambda: len(robot.said) == 2, "it is not reported")
    beating.close()
    assert robot.said[0] == "the robot was not watched: OSError: [Errno 24] Too many open files"
    assert "did not watch" in robot.said[1]


def test_a_move_that_begins_while_the_test_is_silent_is_stopped(robot: Robot, monkeypatch: pytest.MonkeyPatch):
    """Also if the robot was at rest when the silence was noticed."""
    rested = threading.Event()
    going = robot.guard.going

    def look() -> list[int]:
        found = going()
        if not found:
            rested.set()
        return found

    robot.board.stop()
    eventually(robot.board.motion_done, "it goes on")
    monkeypatch.setattr(robot.guard, "going", look)
    beating = Heartbeat("fake")
    beating.beat()
    assert rested.wait(10.0)
    robot.board.position_move([90.0] * 3)
    eventually(lambda: robot.said, "the move is not stopped")
    robot.stops()
    beating.close()
    assert ["did not watch" in line for line in robot.said] == [True]


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGSTOP])
def test_a_part_that_could_not_be_stopped_is_tried_again(
    robot: Robot, watching: subprocess.Popen[str], monkeypatch: pytest.MonkeyPatch, end: signal.Signals
):
    """Until it is stopped, with a report of each; only then is a test that has died forgotten."""
    halt = robot.guard.halt
    failures = [NoAnswerError("it did not answer")]

    def fail_first(joints: Sequence[int]) -> None:
        if failures:
            raise failures.pop()
        halt(joints)

    monkeypatch.setattr(robot.guard, "halt", fail_first)
    os.kill(watching.pid, end)
    robot.stops()
    eventually(lambda: len(robot.said) == 2, "it is not reported")
    assert robot.said[0] == "/fake could not be stopped: it did not answer"
    assert "joint0, joint1, joint2 stopped" in robot.said[1]
    if end is signal.SIGKILL:
        eventually(lambda: not [*heartbeats(robot.folder, "fake")], "it is not forgotten")
