"""A test that does not declare motion cannot move the robot, neither by its parts nor by their boards."""

from __future__ import annotations

import os
from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest

from harness import MARK, run_suite
from rtf import clock
from rtf.bottle import Property
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.boards.server import ControlBoardServer
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.interfaces import PidType
from rtf.robot.network.outlets import PipelinedOutlets
from rtf.robot_testing import MotionGuard, Part
from rtf.robot_testing.guard.read_only_board import ReadOnlyBoard, UndeclaredMotionError, connect_read_only
from rtf.testing.events import Message
from rtf.testing.verdict import Verdict

from ...robot.sensor_bench import ManualClock

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

COMMANDS: dict[str, Callable[[ReadOnlyBoard], object]] = {
    "position": lambda board: board.position_move([5.0], [1]),
    "all positions": lambda board: board.position_move([5.0, 5.0, 5.0]),
    "speed": lambda board: board.set_reference_speeds(7.0, 1),
    "mode": lambda board: board.set_control_modes(ControlMode.IDLE, 1),
    "stiffness": lambda board: board.set_interaction_modes(InteractionMode.COMPLIANT, 1),
    "stop": lambda board: board.stop(1),
    "limits": lambda board: board.set_limits(1, 1.0, 2.0),
    "gains": lambda board: board.set_pid(PidType.POSITION, 1, board.pid(PidType.POSITION, 1)),
    "all gains": lambda board: board.set_pids(PidType.POSITION, board.pids(PidType.POSITION)),
    "streamed speed": lambda board: board.velocity_move(5.0, 1),
    "streamed position": lambda board: board.set_positions(5.0, 1),
    "streamed torques": lambda board: board.set_reference_torques([1.0, 1.0, 1.0]),
    "duty cycle": lambda board: board.set_reference_duty_cycles(5.0, 1),
    "calibration": lambda board: board.calibrate_joint(1),
}


class Bench:
    """A board of three joints behind its ports, and a listener to its commands."""

    def __init__(self, stack: ExitStack) -> None:
        self.network = Network(LocalNames())
        self.time = stack.enter_context(clock.use(ManualClock()))
        self.reported: list[str] = []
        self.device = FakeBoard("fake", network=self.network)
        self.device.open(Property.parse("(GENERAL (Joints 3))"))
        stack.callback(self.device.close)
        self.server = ControlBoardServer(self.device, "/fake", network=self.network, outlets=PipelinedOutlets())
        stack.callback(self.server.close)
        self.board = stack.enter_context(connect_read_only("/fake", carrier="tcp", network=self.network))
        self.server.publish(self.time.now())
        self.server.settle()


@pytest.fixture
def bench() -> Iterator[Bench]:
    """The bench."""
    with ExitStack() as stack:
        yield Bench(stack)


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_no_command_is_sent(bench: Bench, command: Callable[[ReadOnlyBoard], object]):
    """Each command is refused before it is sent, with the remedy in the message."""
    with pytest.raises(UndeclaredMotionError, match=r"declare safety = Safety\.MOTION"):
        command(bench.board)


def test_requests_for_data_are_allowed(bench: Bench):
    """The positions, and everything that a snapshot has."""
    board = bench.board
    assert board.encoders().tolist() == [0.0, 0.0, 0.0]
    assert board.control_modes() == bench.device.control_modes()
    assert board.limits(1) == bench.device.limits(1)
    assert len(board.pids(PidType.POSITION)) == 3
    assert isinstance(board.calibration_done(1), bool)


def test_a_part_without_a_guard_does_not_move(bench: Bench):
    """Its methods raise the same error; measurements can be read."""
    part = Part("fake", bench.board, bench.time, None)
    for move in (lambda: part.move([5.0], [1]), lambda: part.set_mode(ControlMode.IDLE), part.go_home):
        with pytest.raises(UndeclaredMotionError, match="declare safety"):
            move()
    part.wait(0.1)
    assert bench.device.control_modes() == (ControlMode.POSITION,) * 3


def test_a_part_with_a_guard_moves(bench: Bench):
    """A test may create the guard itself; then the board accepts commands."""
    guard = MotionGuard(bench.board, "/fake", clock=bench.time, report=bench.reported.append)
    part = Part("fake", bench.board, bench.time, guard)
    part.board.set_reference_speeds(7.0, 1)
    part.board.position_move([5.0], [1])
    assert bench.device.target_positions(1) == pytest.approx(5.0)


FORGETS = '''
from rtf.bottle import Property
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.publishing import PeriodicPublishing
from rtf.robot.boards.server import ControlBoardServer
from rtf.robot_testing import RobotTest
class Base(RobotTest):
    """Opens a board."""
    def setup(self):
        super().setup()
        board = FakeBoard("fake", network=self.network)
        board.open(Property.parse("(GENERAL (Joints 3))"))
        self.add_cleanup(board.close)
        server = ControlBoardServer(board, "/icubSim/head", network=self.network)
        self.add_cleanup(server.close)
        self.add_cleanup(PeriodicPublishing(server, name="head", report=self.report).stop)
        self.head = self.open_part("head")
class Forgets(Base):
    """Forgets to say that it moves."""
    def run(self): self.head.move([5.0], [1])
class GoesRound(Base):
    """Moves by the board."""
    def run(self): self.head.board.position_move([5.0], [1])
'''


def test_undeclared_motion_is_an_error_of_the_test(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The robot has not failed, and the message has the remedy."""
    monkeypatch.setenv(MARK, f"{os.getpid()}-{tmp_path.name}")
    for name in ("RTF_CLOCK", "YARP_CLOCK", "YARP_ROBOT_NAME"):
        monkeypatch.delenv(name, raising=False)
    suite = '<fixture> yarpserver </fixture><test name="a">Forgets</test><test name="b">GoesRound</test>'
    outcome = run_suite(tmp_path, suite, forgets__py=FORGETS)
    assert [outcome.verdict(name) for name in ("a", "b")] == [Verdict.ERROR, Verdict.ERROR]
    said = [event.detail for event in outcome.of(Message) if isinstance(event, Message)]
    assert sum("declare safety = Safety.MOTION" in text for text in said) == 2, said
