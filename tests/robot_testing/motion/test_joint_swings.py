"""Joints that swing while their encoders are compared: failures, and the other joints after one."""

from __future__ import annotations

import math
from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest

from rtf import clock
from rtf.robot.control_modes import ControlMode
from rtf.robot.yarp3.client import RemoteControlBoard
from rtf.robot_testing.guard.transmission import Transmission
from rtf.robot_testing.motion.joint_swings import Ends, JointSwinger
from rtf.robot_testing.motion.routines import run_queues, run_to_end

from ..part_bench import PartBench

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.interfaces import AxisSelection, FloatArray
    from rtf.robot_testing.motion.routines import Routine


class PreemptedBoard(RemoteControlBoard):
    """A client whose process is suspended for half a second before each reading of the motor encoders."""

    preempted = False

    def motor_encoders(self, motors: AxisSelection = None) -> FloatArray:
        """See IMotorEncoders."""
        if self.preempted:
            clock.current().sleep(0.45)
        return super().motor_encoders(motors)


class Bench(PartBench):
    """A part that swings."""

    board: PreemptedBoard

    def __init__(self, stack: ExitStack) -> None:
        super().__init__(stack, PreemptedBoard)
        self.swinger = JointSwinger(self.part, Transmission.read(self.board), tolerance=1.0)


@pytest.fixture
def bench() -> Iterator[Bench]:
    """The bench."""
    with ExitStack() as stack:
        yield Bench(stack)


def test_joints_that_arrive_pass(bench: Bench):
    """Together and one alone, although the motors of two joints turn with each other."""
    assert bench.swinger.go([10.0, 10.0, -10.0], [0, 1, 2], [20.0] * 3) == {}
    assert bench.swinger.go([-10.0], [1], [20.0]) == {}
    assert bench.board.encoders() == pytest.approx([10.0, -10.0, -10.0], abs=1.0)


def test_a_suspended_process_fails_no_joint(bench: Bench):
    """Joint and motor encoders of the same time are compared, also when another joint was stopped."""
    outcomes = {}

    def routine(joint: int) -> Routine[None]:
        outcomes[joint] = yield from bench.swinger.swinging(joint, Ends(-10.0, 30.0), 1, 10.0)

    bench.board.preempted = True
    bench.device.speeds = {0: 100.0}
    run_queues(bench.part, [[[1]]], routine, pace=0.02)
    assert outcomes[1].complaint.startswith("was not swung to the end: joint0")
    verdict = bench.swinger.verdict(1, outcomes[1])
    assert verdict is not None
    assert not verdict.failed
    assert bench.guard.is_excluded(0)
    assert not bench.guard.is_excluded(1)


def test_what_a_limp_joint_shakes_does_not_fail(bench: Bench):
    """A joint that was stopped after another one had been left without power: that one explains it."""
    outcomes = {}

    def routine(joint: int) -> Routine[None]:
        outcomes[joint] = yield from bench.swinger.swinging(joint, Ends(-10.0, 30.0), 1, 10.0)

    bench.device.speeds = {0: 100.0}
    run_queues(bench.part, [[[1]]], routine, pace=0.02)
    bench.device.speeds = {1: 100.0}
    run_queues(bench.part, [[[2]]], routine, pace=0.02)
    assert bench.guard.is_excluded(1)
    verdict = bench.swinger.verdict(1, outcomes[1])
    assert verdict is not None
    assert not verdict.failed
    assert "joint0" in verdict.text
    first = bench.swinger.verdict(0, bench.swinger.go([0.0], [0], [20.0])[0])
    assert first is not None
    assert first.failed


def test_an_undetected_motion_excludes_the_coupled_joints(bench: Bench):
    """The joint fails; the coupled joint is excluded without a verdict; the others go on."""
    bench.device.shown = {2: 0.0}
    outcomes = bench.swinger.go([10.0] * 3, [0, 1, 2], [20.0] * 3)
    assert "does not move by its encoder," in outcomes[2].complaint
    assert "is coupled with joint2" in outcomes[1].complaint
    assert sorted(outcomes) == [1, 2]
    assert bench.swinger.in_doubt(1) == "is coupled with joint2, which was left without power"
    assert bench.swinger.in_doubt(2) == bench.swinger.in_doubt(0) == ""
    assert [bench.guard.is_excluded(joint) for joint in range(3)] == [False, True, True]
    assert bench.device.control_modes() == (ControlMode.POSITION, ControlMode.IDLE, ControlMode.IDLE)
    again = bench.swinger.go([0.0] * 3, [0, 1, 2], [20.0] * 3)
    assert "is coupled with joint2" in again[1].complaint
    assert "does not obey any more" in again[2].complaint


def test_a_joint_that_loses_its_power_on_the_way_is_in_doubt(bench: Bench):
    """It is coupled with one that is stopped, and moves at the same time: it waits no longer, and is not late."""
    outcomes = {}

    def routine(joint: int) -> Routine[None]:
        if joint == 2:
            bench.device.speeds = {2: 100.0}
        outcomes[joint] = yield from bench.swinger.swinging(joint, Ends(-10.0, 30.0), 1, 10.0)

    begin = bench.time.now()
    run_queues(bench.part, [[[1]], [[2]]], routine, pace=0.02)
    assert bench.time.now() - begin < 3.0  # a swing takes three seconds, and may take eleven
    assert outcomes[2].complaint.startswith("had to be stopped: joint2")
    assert bench.guard.is_excluded(1)
    verdict = bench.swinger.verdict(1, outcomes[1])
    assert verdict is not None
    assert (verdict.failed, verdict.text) == (
        False, "joint1 is coupled with joint2, which was left without power: it cannot be judged",
    )  # fmt: skip


def test_a_joint_that_overruns_before_it_turns_back_has_moved(bench: Bench):
    """At the end of a swing it still moves, so at the begin of the next it has not been at rest."""
    routine = bench.swinger.moving([10.0], [0], [20.0])
    next(routine)
    for place in (-0.5, -1.0, -1.0, -0.5, 0.0):  # its motor turns by a degree each time
        bench.device.shown = {0: place}
        bench.time.sleep(0.05)
        next(routine)
    bench.device.shown = {}
    assert run_to_end(bench.part, routine, pace=0.02) == {}


def test_a_joint_without_a_position_has_not_arrived(bench: Bench):
    """NaN is within no tolerance."""
    bench.part.guard = None  # which would stop it at once
    bench.device.shown = {0: math.nan}
    bench.publish()
    outcomes = bench.swinger.go([10.0], [0], [20.0])
    assert "does not reach 10.0 deg in time; it is at nan deg" in outcomes[0].complaint
