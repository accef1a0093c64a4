"""The guard stops the joints of a part whose boards are on a CAN bus, when one of the boards is lost in a motion."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pytest

from icub import ICUB
from rtf import clock
from rtf.middleware.clocks.network_clock import LockstepClock
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.boards.client import connect
from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import RobotError, StaleStateError
from rtf.robot_testing.guard.limits import Limits
from rtf.robot_testing.guard.motion_guard import MotionGuard
from rtf.robot_testing.motion.part import Part
from rtf.simulator.faults import find_kind
from rtf.simulator.robot import SimulatedRobot

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

#: The board of neck_yaw and eyes_tilt, and its joints.
BOARD, JOINTS = "head0:2", (2, 3)
#: Seconds from a fault until the other joints rest: a state is too old after half a second, and they slow down.
LATEST = 1.0


class Head(NamedTuple):
    """The head of a simulated robot, and the same robot itself."""

    robot: SimulatedRobot
    part: Part

    def speeds(self) -> np.ndarray:
        """Return the true speeds of its joints (deg/s)."""
        boards = self.robot.simulation.boards
        own = self.robot.model.part_slice("head")
        return np.abs(boards.trajectories.at(boards.tick, [*range(own.start, own.stop)])[1])


@pytest.fixture
def head(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Head]:
    """The head with a guard, in lockstep, and all joints in position mode."""
    network = Network(LocalNames())
    monkeypatch.setenv("YARP_RUNTIME_DIR", str(tmp_path))
    with ExitStack() as stack:
        robot = stack.enter_context(SimulatedRobot(ICUB, network=network, parts=("head",), lockstep=True, can=True))
        time = stack.enter_context(clock.use(LockstepClock("/clock", "test", network=network)))
        stack.callback(time.close)
        board = stack.enter_context(connect("/icubSim/head", carrier="tcp", network=network))
        time.sleep(0.1)
        guard = MotionGuard(board, "/icubSim/head", clock=time, report=print, robot=ICUB, limits=Limits(fault=True))
        yield Head(robot, Part("head", board, time, guard))


def secure(part: Part) -> None:
    """End the test as the clean-up of a robot test does; the board stays lost, which is an error."""
    assert part.guard is not None
    with pytest.raises(RobotError, match="head could not be restored"):
        part.guard.restore()


@pytest.mark.parametrize("kind", ["can_bus_off", "can_board_reset"])
def test_a_board_that_is_lost_in_a_motion_stops_the_part(head: Head, kind: str):
    """Off the bus, or reset: the other joints rest soon, and the motion is over for all of them."""
    part, time = head.part, head.part.clock
    joints = [joint for joint in range(part.axes) if joint not in JOINTS]
    part.board.set_control_modes([ControlMode.FORCE_IDLE] * part.axes)
    time.sleep(0.2)
    part.board.set_control_modes([ControlMode.POSITION] * part.axes)
    time.sleep(0.2)
    here = part.board.encoders()
    fault = find_kind(kind)(head.robot, BOARD, {})
    head.robot.simulation.after(0.5, fault.start)
    begin = time.now()
    with pytest.raises(RobotError) as stopped:  # a stop by the guard, or a state that is too old
        part.move(here + 15.0, speed=5.0)
    assert 0.5 <= time.now() - begin < 0.5 + LATEST
    if isinstance(stopped.value, StaleStateError):
        secure(part)
    time.sleep(max(0.0, 0.5 + LATEST - (time.now() - begin)))
    assert head.speeds()[joints].max() < 0.1
    fault.end()
    time.sleep(1.0)
    assert (np.abs(part.board.encoders() - here)[joints] < 10.0).all()
