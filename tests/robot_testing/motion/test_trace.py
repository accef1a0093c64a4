"""Recorded states: times by the stamps of the board, and by the clock of the test where the two differ."""

from __future__ import annotations

from contextlib import ExitStack

import numpy as np
import pytest

from rtf import clock
from rtf.robot.extended_state import ExtendedState
from rtf.robot_testing.motion.trace import Trace, wrong_stamps

from ..part_bench import LocalTime, PartBench


@pytest.mark.parametrize("ahead", [-0.1, 3600.0])
def test_stamps_of_another_clock_are_converted(ahead: float):
    """The clock of a real robot may be anywhere; the local times are those of the test's clock."""
    with ExitStack() as stack:
        bench = PartBench(stack, local=True)
        bench.device.ahead = ahead
        with bench.part.recorded() as trace:
            for _ in range(5):
                bench.time.sleep(0.1)
        assert trace.offset == pytest.approx(-ahead)
        assert trace.local_time == pytest.approx(bench.time.now() - 0.1 * np.arange(5)[::-1])
        said: list[str] = []
        bench.part.report_clock_offset(said.append)
        assert len(said) == 1
        assert f"{abs(ahead):.3f} s {'ahead of' if ahead > 0 else 'behind'} this machine's" in said[0]


def test_a_late_message_does_not_change_the_offset():
    """The median delay counts, not that of a message that a busy machine delayed."""
    with clock.use(LocalTime()) as time:
        trace = Trace()
        for age in (0.0, 0.0, 5.0):
            trace.add(time.now() - age, ExtendedState(1))
        assert trace.offset == 0.0


def test_stamps_of_a_simulators_clock_are_not_converted():
    """To the last bit, and no offset is reported."""
    with ExitStack() as stack:
        bench = PartBench(stack)
        bench.device.ahead = 0.1
        with bench.part.recorded() as trace:
            for _ in range(3):
                bench.time.sleep(0.1)
        assert trace.offset == 0.0
        assert np.array_equal(trace.local_time, trace.time)
        assert trace.clocks_apart == ""
        assert Trace().offset == 0.0


def test_stamps_that_repeat_or_go_back_are_reported():
    """Their times are not known; the states are kept."""
    trace = Trace()
    for stamp in (1.0, 1.01, 1.01, 1.03):
        trace.add(stamp, ExtendedState(1))
    assert wrong_stamps(trace.time) == "1 of 4 states have time stamps that repeat or go back"
    trace.add(1.02, ExtendedState(1))
    assert wrong_stamps(trace.time).startswith("2 of 5")
    assert wrong_stamps(Trace().time) == ""


def test_a_reading_that_jumps_does_not_count_as_a_position():
    """The median of the last five; of fewer if there are no more."""
    trace = Trace()
    with pytest.raises(IndexError, match="no state"):
        trace.median_positions()
    for stamp, position in enumerate((90.0, 1.0, 1.0, 45.0, 1.5, 2.0)):
        state = ExtendedState(1)
        state.joint_positions[0] = position
        trace.add(float(stamp), state)
    assert trace.median_positions() == [1.5]
    assert trace.median_positions(1) == [2.0]
