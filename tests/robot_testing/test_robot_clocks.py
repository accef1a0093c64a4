"""Tests that judge times, with a robot whose clock differs from the machine's."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

import numpy as np
import pytest

from rtf.robot.control_modes import ControlMode
from rtf.robot_testing.judging.sine import RampedSine
from rtf.robot_testing.judging.step_response import step_response
from rtf.robot_testing.motion.routines import run_to_end

from .kept_test import kept_test
from .part_bench import PartBench

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture(params=[0.1, -0.1, 1e6])
def bench(request: pytest.FixtureRequest) -> Iterator[PartBench]:
    """A board whose clock is ahead of the test's by these seconds."""
    with ExitStack() as stack:
        bench = PartBench(stack, local=True)
        bench.device.ahead = request.param
        yield bench


def test_the_delay_of_a_step_is_without_the_offset(bench: PartBench):
    """The joint follows at once, in the next state."""
    test = kept_test("PositionControlAccuracy", robot_part=bench.part, clock=bench.time, chosen=[0])
    test.robot_name, test.starts, test.step, test._ends = "bot", {0: (0.0, 1.0)}, 1.0, {}
    cycle = run_to_end(bench.part, test._cycle(0), pace=test.sample_time)
    answer = step_response(cycle.time, cycle.measured, cycle.start, cycle.target, test.band)
    assert 0.0 <= answer.delay <= 0.03
    assert cycle.late == ""
    bench.part.report_clock_offset(test.report)
    assert "the robot's clock is" in test.kept.reports[0]


def test_the_delay_of_a_sine_is_without_the_offset(bench: PartBench):
    """A tenth of a second would be an error of two degrees."""
    test = kept_test("PositionDirect", robot_part=bench.part, clock=bench.time, chosen=[0], middle=np.zeros(1))
    test.frequency, test.sine = 1.0, RampedSine(np.array([3.0]), 1.0, 1.0)
    bench.part.set_mode(ControlMode.POSITION_DIRECT)
    run = test._follow(bench.part, 2)
    test._judge("joint0", 0, 0, run)
    assert test.kept.failures == []
    assert test.kept.values["delay"] <= 0.03


def test_the_rise_of_a_move_begins_at_its_command(bench: PartBench):
    """Although its stamps seem to be before the command, or long after it."""
    test = kept_test("MotorTest", robot_part=bench.part, clock=bench.time, chosen=[0])
    test.targets, test.speeds = np.array([10.0]), np.array([20.0])
    test.low, test.high = test.targets - 1.0, test.targets + 1.0
    test._move("single", [0], test.targets)
    assert test.kept.ended == {}
    assert test.kept.failures == []
    assert test.kept.values["settling"] == pytest.approx(0.95, abs=0.2)
