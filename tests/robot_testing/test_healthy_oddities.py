"""Unusual behaviour of healthy robots and busy machines that is no failure, and faults that look healthy."""

from __future__ import annotations

import math
from contextlib import ExitStack
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from rtf import clock
from rtf.robot.yarp3.client import RemoteControlBoard
from rtf.robot_testing.guard.transmission import Transmission
from rtf.robot_testing.judging.orientations import each_once, turns_of
from rtf.robot_testing.motion.joint_swings import Ends, JointSwinger
from rtf.robot_testing.motion.routines import run_to_end
from rtf.robot_testing.robot_test import RobotTest
from rtf.robot_testing.streams.message import Message
from rtf.testing.verdict import Inconclusive, TestFailure, TestProblem

from .kept_test import kept_test
from .part_bench import PartBench

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.interfaces import AxisSelection


class SuspendedClient(RemoteControlBoard):
    """A client whose process is suspended for a second at its first request whether a move is done."""

    asked = False

    def motion_done(self, joints: AxisSelection = None) -> bool:
        """See IPositionControl."""
        if not self.asked:
            self.asked = True
            clock.current().sleep(0.4)
            clock.current().sleep(0.4)
            clock.current().sleep(0.4)
        return super().motion_done(joints)


@pytest.fixture
def bench() -> Iterator[PartBench]:
    """The bench."""
    with ExitStack() as stack:
        yield PartBench(stack)


def test_a_motor_that_turns_with_another_joint_is_not_frozen():
    """Motors are numbered as they are wired, so a joint and its motor may have different numbers."""
    with ExitStack() as stack:
        bench = PartBench(stack, coupling=np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
        transmission = Transmission.read(bench.board)
        swinger = JointSwinger(bench.part, transmission, tolerance=1.0)
        test = kept_test("OpticalEncodersConsistency", robot_part=bench.part, transmission=transmission, chosen=[0])
        with bench.part.recorded() as trace:
            outcome = run_to_end(bench.part, swinger.swinging(0, Ends(-10.0, 10.0), 2, 20.0), pace=0.02)
        assert outcome.complaint == ""
        test.swinger, test._swings = swinger, {0: type("Swing", (), {"trace": trace})}
        test._judge(0, outcome, trace)
        assert test.kept.failures == []
        assert test.kept.values["speed of the joint, derived by reported"] == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(("factor", "fails"), [(1.0, False), (0.8, True)])
def test_speeds_in_coarse_steps_are_judged_by_their_means(factor: float, fails: bool):
    """A motor encoder of 40 counts a turn shows none, one or two in 8 ms; only the mean is its speed."""
    step, time = 0.18, 0.01 * np.arange(400)  # deg of the joint, behind a gear of 50

    def counted(then: np.ndarray) -> np.ndarray:
        return np.rint(10.0 * np.arcsin(np.sin(np.pi * then)) / (0.5 * np.pi) / step)

    speeds = factor * step * (counted(time) - counted(time - 0.008)) / 0.008
    test = kept_test("OpticalEncodersConsistency", robot_part=SimpleNamespace(names=["eye"]))
    test._judge_speed(0, "motor", time, step * counted(time), speeds)
    assert bool(test.kept.failures) is fails
    assert test.kept.values["speed of the motor, derived by reported"] == pytest.approx(1.0 / factor, rel=0.05)


def test_a_speed_that_stands_still_is_a_failure():
    """A board that always reports the same speed of a joint that moves does not update it."""
    test, time = (
        kept_test("OpticalEncodersConsistency", robot_part=SimpleNamespace(names=["eye"])),
        0.01 * np.arange(400),
    )
    with pytest.raises(TestFailure, match="eye: the measured speed of the joint is 0 deg/s all the time"):
        test._judge_speed(0, "joint", time, np.sin(time), np.zeros(400))


def test_frozen_stamps_are_a_failure():
    """From the beginning, in the warm-up, and after it. Numbers that stand still are another failure."""
    test = kept_test("PortsFrequency")
    for moving in (0, 10, 20):
        stamps = [0.01 * min(number, moving) for number in range(200)]
        messages = [Message(number, stamp, 0.01 * number, 8, number, None) for number, stamp in enumerate(stamps)]
        with pytest.raises(TestFailure, match=r"the stamps of /bot/x:o do not advance: 1\d\d messages have the same"):
            test.judged(messages, 1.0, "/bot/x:o")
    for speed in (0.0, 0.01):
        messages = [Message(7, speed * number, 0.01 * number, 8, 7, None) for number in range(200)]
        with pytest.raises(TestFailure, match=r"1\d\d messages of /bot/x:o have the number 7"):
            test.judged(messages, 1.0, "/bot/x:o")


def test_a_sensor_without_finite_values_fails():
    """NaN never counts as a repeated value."""
    test = kept_test("SensorsDuplicateReadings", network=None)
    values = np.random.default_rng(1).normal(size=(50, 3))
    test._judge_channels("/bot/analog:o", values)
    values[10, 1] = math.nan
    values[:, 2] = math.inf
    with pytest.raises(TestFailure, match=r"^channel 1, channel 2 of /bot/analog:o sends values that are"):
        test._judge_channels("/bot/analog:o", values)


def test_repeated_measurements_have_no_angular_velocity():
    """A server that is faster than its sensor repeats them."""
    times = np.repeat([1.0, 2.0, 3.0], 4)
    places = each_once(times)
    assert places == [0, 4, 8]
    still = np.broadcast_to(np.eye(3), (3, 3, 3))
    assert turns_of(still, times[places], 1).tolist() == [[0.0] * 3] * 2


def test_a_joint_without_a_range_cannot_be_stepped(bench: PartBench, monkeypatch: pytest.MonkeyPatch):
    """It is named before anything moves."""
    monkeypatch.setattr(RobotTest, "setup", lambda test: None)
    test = kept_test("PositionControlAccuracy", joints=[0, 1], open_part=lambda name: bench.part)
    bench.part.high[1] = bench.part.low[1]
    with pytest.raises(TestProblem, match="no room for a step: the limits of joint1 leave no range"):
        test.setup()


def test_duty_cycles_may_be_quantized(bench: PartBench):
    """A board reports 2 % with the resolution of its timer; a larger deviation is a failure."""
    test = kept_test("MovementReferencesTest", robot_part=bench.part, chosen=[0, 1], way=np.array([1.0, -1.0]))
    for step, fails in ((0.13, False), (0.7, True)):
        bench.device.duty_step = step
        test.kept.failures.clear()
        test._duty()
        assert any("reference duty cycle" in text for text in test.kept.failures) is fails


def test_a_move_that_ended_before_the_first_state_has_begun():
    """A busy machine reports it, and the joint does not fail."""
    with ExitStack() as stack:
        bench = PartBench(stack, SuspendedClient)
        test = kept_test("MotorTest", robot_part=bench.part, clock=bench.time, chosen=[0])
        test.targets, test.speeds = np.array([10.0]), np.array([20.0])
        test.low, test.high = test.targets - 1.0, test.targets + 1.0
        test._move("single", [0], test.targets)
        assert test.kept.failures == []
        assert isinstance(test.kept.ended["joint0 single"], Inconclusive)
