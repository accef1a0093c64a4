"""Tests of CAN buses and boards, on a robot with emulated boards: faults are found and named."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from rtf.testing.events import Measured
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from conftest import Runs

    from harness import Outcome

SUITE = """
<test name="load"> <parameter name="part">head</parameter> <parameter name="time">1</parameter> CanBusLoad </test>
<test name="babbling">
    <parameter name="part">head</parameter> <parameter name="time">1</parameter>
    <parameter name="inject">can_babbling head0 identifier=0</parameter> CanBusLoad
</test>
<test name="boards">
    <parameter name="part">head</parameter>
    <parameter name="inject">can_settings_ignored head0:2</parameter> CanBoards
</test>
<test name="timeouts">
    <parameter name="part">head</parameter> <parameter name="timeout">0.5</parameter> CanTimeouts
</test>
<test name="no driver">
    <parameter name="part">head</parameter> <parameter name="interface">socketcan</parameter> CanBusLoad
</test>
"""


@pytest.fixture(scope="module")
def outcome(run_on_robot: Runs) -> Outcome:
    """One robot for all."""
    return run_on_robot(SUITE, can="true", parts="head")


def test_a_healthy_bus_passes(outcome: Outcome):
    """Load, rates, order, answers, counts of errors."""
    assert outcome.verdict("load") is Verdict.PASSED, outcome.stdout


def test_a_board_that_sends_without_end_is_named_by_its_identifier(outcome: Outcome):
    """Even when nothing else gets through: its frames have the highest priority."""
    assert outcome.verdict("babbling") is Verdict.FAILED
    assert "0x000" in outcome.stdout


def test_a_board_that_takes_no_settings_is_named_with_its_joints(outcome: Outcome):
    """What it has is compared with what was sent."""
    assert outcome.verdict("boards") is Verdict.FAILED
    assert "board head0:2 (neck_yaw, eyes_tilt): it does not take a new set_max_velocity" in outcome.stdout


def test_time_outs_are_measured(outcome: Outcome):
    """A time-out that is expected to be shorter than it is fails: all joints stop, and none before its time."""
    assert outcome.verdict("timeouts") is Verdict.FAILED
    times = [one.value for one in outcome.of(Measured, name="time until it stops")]
    assert len(times) == 6
    assert all(1.0 < time < 1.2 for time in times)


def test_an_interface_that_is_not_there_is_an_error(outcome: Outcome):
    """Not a defect of the robot."""
    assert outcome.verdict("no-driver") is Verdict.ERROR
    assert "head0" in outcome.stdout
