"""Parts: modes that boards refuse, excluded joints, and moves that do not arrive."""

from __future__ import annotations

import math
from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest

from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import RefusedError
from rtf.robot_testing.motion.part import Part
from rtf.robot_testing.motion.start_position import hold, late_joints
from rtf.robot_testing.robot_test import RobotTest
from rtf.testing.session import Session
from rtf.testing.verdict import TestFailure, TestProblem

from ..part_bench import Joints, PartBench

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

POSITION, DIRECT, IDLE = ControlMode.POSITION, ControlMode.POSITION_DIRECT, ControlMode.IDLE


@pytest.fixture
def bench() -> Iterator[PartBench]:
    """The bench."""
    with ExitStack() as stack:
        yield PartBench(stack)


@pytest.fixture
def test(bench: PartBench, tmp_path: Path) -> Joints:
    """A test of all joints of the part."""
    made = Joints()
    made.attach_to(Session("t", lambda _: None, folder=tmp_path, run_folder=tmp_path), "")
    made.robot_part, made.chosen = bench.part, [0, 1, 2]
    return made


def test_joints_that_refuse_a_mode_are_named(bench: PartBench, test: Joints):
    """Boards answer with an error for all joints; the mode of each shows which one has refused."""
    assert bench.part.set_mode(DIRECT, [0])
    bench.device.refuses = True
    assert not bench.part.set_mode(DIRECT)
    assert bench.board.control_modes() == (DIRECT, POSITION, POSITION)
    with pytest.raises(TestFailure, match="does not take position mode: joint0 stays in"):
        test.hold()


def test_joints_without_interaction_modes_are_held(bench: PartBench, test: Joints):
    """Over the network such boards only answer with an error."""
    bench.device.refuses = True
    hold(bench.part, [0, 1, 2])
    test.hold()


def test_excluded_joints_get_no_power(bench: PartBench, test: Joints):
    """Nor does any move of the part wait for them."""
    part = bench.part
    bench.guard.exclude(1, "it does not obey")
    bench.time.sleep(0.1)
    bench.device.asked.clear()
    assert part.held() == [0, 2]
    assert part.set_mode(DIRECT)
    test.hold()
    test.bring_home()
    hold(part, [0, 1, 2])
    assert part.go_home().reached
    arrival = part.move([5.0, 6.0, 7.0])
    assert arrival.reached
    assert arrival.positions == pytest.approx([5.0, 0.0, 7.0], abs=0.5)
    assert bench.device.asked
    assert all(1 not in joints for _, joints in bench.device.asked)
    assert bench.device.control_modes() == (POSITION, IDLE, POSITION)


def test_an_excluded_joint_enters_no_mode_and_does_not_arrive(bench: PartBench):
    """Alone it is reported at once; a command for no joint succeeds."""
    bench.guard.exclude(1, "it does not obey")
    before = bench.time.now()
    assert not bench.part.set_mode(POSITION, [1])
    assert not bench.part.move([5.0], [1]).reached
    assert bench.time.now() == before
    assert bench.part.set_mode(POSITION, [])
    assert bench.part.move([], []).reached


def test_a_required_move_names_the_joints_beyond_its_tolerance(bench: PartBench):
    """However small the tolerance is."""
    bench.device.shown = {1: 0.3}
    part = bench.part
    arrival = part.move([5.0, 0.0, 0.0], tolerance=0.2, timeout=2.0)
    with pytest.raises(TestProblem, match=r"did not reach home within 2.0 s: joint1 is at 0.30 deg, not 0.00 deg$"):
        RobotTest.require(Joints(), arrival, "home", part, [0, 1, 2], [5.0, 0.0, 0.0])


def test_a_joint_within_the_tolerance_moves_slowly(bench: PartBench, monkeypatch: pytest.MonkeyPatch):
    """The next command interrupts the move. Later commands of the test have the speed of the move."""
    commands: list[tuple[str, list[float]]] = []
    for name in ("set_reference_speeds", "position_move"):
        monkeypatch.setattr(bench.part.board, name, lambda values, _, name=name: commands.append((name, list(values))))
    arrival = bench.part.move([0.1, 0.4, 30.0], speed=20.0, tolerance=0.5, timeout=0.1)
    assert not arrival.reached
    speeds, targets, after = commands
    assert speeds == ("set_reference_speeds", pytest.approx([1.0, 2.0, 20.0]))
    assert targets == ("position_move", [0.1, 0.4, 30.0])
    assert after == ("set_reference_speeds", [20.0, 20.0, 20.0])
    commands.clear()
    bench.part.move([0.1, 0.1, 0.1], speed=[0.4, 20.0, 1.0], timeout=0.1)
    assert commands[0][1] == [0.4, 1.0, 1.0]
    commands.clear()
    bench.part.move([10.0, 20.0], [1, 2], speed=5.0, timeout=0.1)
    assert [name for name, _ in commands] == ["set_reference_speeds", "position_move"]


def test_a_joint_without_a_position_has_not_arrived(bench: PartBench):
    """NaN is within no tolerance."""
    bench.part._need_guard = lambda what: None
    bench.part.guard = None  # which would stop it at once
    bench.device.shown = {1: math.nan}
    bench.publish()
    assert list(late_joints(bench.part, [0, 1], [1.0, 1.0])) == [1]


def test_prismatic_joints_are_left_out(bench: PartBench):
    """By default; a named one is refused. No move of the part moves them."""
    part, bench.guard.sliding = bench.part, frozenset({1})
    assert part.select([]) == part.held() == [0, 2]
    with pytest.raises(RefusedError, match="joint1 of fake is prismatic"):
        part.select([0, 1])
    bench.device.asked.clear()
    assert part.move([5.0, 6.0, 7.0]).positions == pytest.approx([5.0, 0.0, 7.0], abs=0.5)
    assert part.go_home().reached
    assert all(1 not in joints for _, joints in bench.device.asked)
    bench.guard.sliding = frozenset({0, 1, 2})
    with pytest.raises(RefusedError, match="no joint of fake is revolute"):
        part.select([])


def test_a_test_without_motion_has_prismatic_joints(bench: PartBench):
    """It does not move them."""
    assert Part("fake", bench.board, bench.time, None).select([]) == [0, 1, 2]
