"""``kill -9`` of a robot test that runs by itself, in mid-motion: of its process, and of the runner.

The robot runs already, in real time, and stays. RTF adds a fixture ``robot``, which puts it back. The kill comes when
the board itself shows that a joint is far from its place under weakened gains, and not after some time.
"""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import ExitStack
from importlib.util import find_spec
from typing import TYPE_CHECKING

import pytest

from harness import Command, marked
from rtf.middleware.naming import configuration
from rtf.middleware.naming.configuration import find_network
from rtf.middleware.naming.server import NameServer
from rtf.robot.boards.client import connect
from rtf.robot.errors import StaleStateError
from rtf.robot.interfaces import Pid, PidType
from rtf.robot.yarp3.client import RemoteControlBoard
from rtf.simulator.control_client import SimulatorControl
from rtf.testing.events import FixtureChanged, TestStarted
from rtf.testing.verdict import FixtureState, Verdict
from waiting import eventually

from .test_kill import events_so_far, kill

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

pytestmark = [
    pytest.mark.torture,
    pytest.mark.skipif(not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"),
]

#: A slow test, so that a joint moves for many seconds. The fault has no effect but must be removed.
TEST = ("--test", "JointLimits", "--set", "part=torso", "--set", "speed=5", "--set", "inject=encoder_bias neck_yaw")
_FAR, _NEAR = 10.0, 2.0  # deg
_LIMIT = 120.0


class Robot:
    """A simulated torso and head that these tests do not end, and a client that only reads."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self.folder = folder
        ready = folder / "ready"
        words = ["--parts", "torso,head", "--realtime-factor", "1", "--ready-file", str(ready)]
        program = subprocess.Popen([sys.executable, "-m", "rtf", "simulator", *words], cwd=folder)
        stack.callback(program.wait, 30)
        stack.callback(program.terminate)
        eventually(ready.exists, "the simulator does not come up", _LIMIT)
        network = find_network()
        self.board: RemoteControlBoard = stack.enter_context(connect("/icubSim/torso", timeout=5.0, network=network))
        self.control = stack.enter_context(SimulatorControl("icubSim", network=network))
        eventually(self._stands, "the robot does not come to rest", _LIMIT)
        self.home = self.board.encoders()
        self.gains = self.board.pids(PidType.POSITION)
        self.modes = self.board.control_modes()

    def _stands(self) -> bool:
        try:
            return bool((abs(self.board.encoder_speeds()) < 0.1).all())
        except StaleStateError:
            return False

    def is_far(self) -> bool:
        """Return whether a joint moves, far from its place, with other gains than before."""
        away = abs(self.board.encoders() - self.home)
        return bool((away > _FAR).any()) and self._gains() != self.gains and not self.board.motion_done()

    def _gains(self) -> tuple[Pid, ...]:
        return self.board.pids(PidType.POSITION)

    def check_put_back(self) -> None:
        """Check that the robot is as it was, and has no fault."""
        assert abs(self.board.encoders() - self.home).max() < _NEAR
        assert self._gains() == self.gains
        assert self.board.control_modes() == self.modes
        assert self.board.motion_done()
        assert self.control.active() == ()


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Robot]:
    """A name server and a robot, as the user's configuration finds them."""
    monkeypatch.setenv("YARP_CONFIG_HOME", str(tmp_path / "user"))
    for name in ("YARP_NAMESPACE", "YARP_PORT_PREFIX", "RTF_CLOCK", "YARP_CLOCK", "YARP_ROBOT_NAME"):
        monkeypatch.delenv(name, raising=False)
    with NameServer() as names, ExitStack() as stack:
        configuration.write_place(names.contact)
        yield Robot(tmp_path, stack)


def pid_of_test(folder: Path) -> int:
    """Return the process of the test that runs."""
    (started,) = [event for event in events_so_far(folder) if isinstance(event, TestStarted)]
    return started.pid


def wait_till_far(robot: Robot, command: Command) -> None:
    """Wait until the run has moved a joint; fail with the outcome of a run that ends before."""

    def is_far() -> bool:
        assert command.process.poll() is None, f"the run ended before: {command.wait()}"
        return robot.is_far()

    eventually(is_far, "no joint moves", _LIMIT)


@pytest.mark.usefixtures("no_process_left")
def test_a_killed_test_is_cleaned_up_after(robot: Robot):
    """A killed test is an error, and its joints, gains and faults are put back before the run ends."""
    command = Command(robot.folder, *TEST)
    wait_till_far(robot, command)
    kill(pid_of_test(robot.folder))
    outcome = command.wait(_LIMIT)
    assert outcome.verdict("JointLimits") is Verdict.ERROR
    assert outcome.of(FixtureChanged)[-1].state is FixtureState.STOPPED  # type: ignore[attr-defined]
    robot.check_put_back()


@pytest.mark.usefixtures("no_process_left")
def test_a_killed_runner_is_cleaned_up_after(robot: Robot):
    """When the runner is killed, the fixture puts the robot back by itself, and then no process is left."""
    command = Command(robot.folder, *TEST)
    wait_till_far(robot, command)
    kill(command.process.pid)
    command.process.communicate(timeout=_LIMIT)
    eventually(lambda: [one for one in marked(command.mark) if one.pid != os.getpid()] == [], "some are left", _LIMIT)
    robot.check_put_back()
