"""The guard on a board that cannot take the power of its joints, as those of ROS 2: it holds them where they are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from rtf import clock
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.boards.client import connect
from rtf.robot.control_modes import HOLDING_MODES, ControlMode
from rtf.robot.devices.fake_board import FakeBoard, FakeDriver
from rtf.robot_testing.guard.motion_guard import MotionGuard
from served import served
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.extended_state import ExtendedState


class StuckDriver(FakeDriver):
    """A board with positions only, whose joint 1 stands at 10 deg whatever its setpoint is."""

    supported = HOLDING_MODES

    def read(self, state: ExtendedState) -> None:
        super().read(state)
        state.joint_positions[1] = 10.0


@pytest.fixture
def boards() -> Iterator[tuple[FakeBoard, RemoteBoard]]:
    """The board, and its client."""
    network = Network(LocalNames())
    board = FakeBoard("board", driver=StuckDriver(), network=network)
    with (
        served(board, "/robot/arm", network=network, period=0.01),
        connect("/robot/arm", carrier="tcp", network=network) as client,
    ):
        eventually(lambda: client.control_modes() == (ControlMode.POSITION,) * 3, "no state")
        yield board, client


def test_a_joint_that_presses_is_held_where_it_is(boards: tuple[FakeBoard, RemoteBoard]):
    """Its setpoint is its position afterwards, so it presses no more."""
    board, client = boards
    client.set_control_modes([ControlMode.POSITION_DIRECT], [1])
    client.set_positions([50.0], [1])
    eventually(lambda: board.reference_positions([1])[0] == 50.0, "the setpoint does not arrive")
    guard = MotionGuard(client, "/robot/arm", clock=clock.current(), report=print)
    guard.reactions.release([1])
    assert board.control_mode(1) is ControlMode.POSITION
    assert board.target_positions([1])[0] == 10.0
    assert board.reference_positions([1])[0] == 10.0


def test_an_excluded_joint_is_held_and_the_part_is_restored(boards: tuple[FakeBoard, RemoteBoard]):
    """It is reported, and no other test is kept from moving the part."""
    board, client = boards
    said: list[str] = []
    guard = MotionGuard(client, "/robot/arm", clock=clock.current(), report=said.append)
    guard.exclude(1, "it does not move")
    assert said[-1].endswith(" is held, as its board cannot take its power: it does not move")
    guard.watch_excluded()
    guard.restore()
    assert board.control_modes() == (ControlMode.POSITION,) * 3
    another = MotionGuard(client, "/robot/arm", clock=clock.current(), report=said.append)
    another.adopt_exclusions([1])
    another.watch_excluded()
    another.watch_excluded()
    another.restore()
