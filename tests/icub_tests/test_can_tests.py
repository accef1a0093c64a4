"""Tests of CAN buses and boards, on a robot with emulated boards: faults are found and named."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

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


def test_an_interface_that_is_not_there_is_an_error(outcome: Outcome):
    """Not a defect of the robot."""
    assert outcome.verdict("no-driver") is Verdict.ERROR
    assert "head0" in outcome.stdout
