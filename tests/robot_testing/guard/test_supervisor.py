"""The supervisor: a robot stops when the process of a test dies or hangs, and what presses is released for it."""

from __future__ import annotations

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
from rtf.robot.errors import StaleStateError
from rtf.robot.publishing import PeriodicPublishing
from rtf.robot_testing.guard.heartbeat import Heartbeat, heartbeats
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.guard.motion_guard import MotionGuard
from rtf.robot_testing.guard.supervisor import SILENCE, Supervisor
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator
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
        self.board = stack.enter_context(connect("/fake", network=network))
        eventually(self._has_state, "no state arrives")
        self.said: list[str] = []
        self.may_move = True
        self.guard = MotionGuard(self.board, "/fake", clock=clock.SystemClock(), report=self.said.append)
        self.supervisor = Supervisor(
            [self.guard], using=threading.Lock(), may_move=lambda: self.may_move, report=self.said.append
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
        eventually(self.board.motion_done, "it goes on", 5.0)


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
    eventually(lambda: robot.said, "it is not reported", 5.0)
    assert [why in line for line in robot.said] == [True]
    assert "joint0, joint1, joint2 stopped" in robot.said[0]


def test_a_test_that_watches_again_is_told(robot: Robot):
    """Once: its joints did not fail, they were stopped. Before it begins to watch, nothing is expected of it."""
    beating = Heartbeat("fake")
    assert [heard.silence() for heard in heartbeats(robot.folder)] == [0.0]
    assert beating.beat() == ""
    robot.stops()
    deadline = clock.Deadline.after(5.0)
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
        deadline = clock.Deadline.after(5.0)
        while not deadline.expired:
            guard.watch()

    with pytest.raises(GuardError, match="the robot was stopped: the guard of the test did not watch"):
        watch_on()
    beating.close()


def test_a_test_that_has_ended_properly_stops_nothing(robot: Robot):
    """What goes on then was restored by its guard."""
    beating = Heartbeat("fake")
    beating.beat()
    beating.close()
    robot.supervisor.check()
    assert list(heartbeats(robot.folder)) == []
    assert not robot.board.motion_done()


def test_a_robot_that_may_not_move_is_left_alone(robot: Robot, watching: subprocess.Popen[str]):
    """No command is sent to a real robot without permission."""
    robot.may_move = False
    watching.kill()
    watching.wait()
    robot.supervisor.check()
    assert robot.board.control_modes() == (ControlMode.POSITION,) * 3
    assert not robot.board.motion_done()
    assert robot.said == []
