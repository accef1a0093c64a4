"""Outcomes are plain data."""

from __future__ import annotations

import dataclasses
import pickle

import pytest

from rtf.campaigns import Measured, Outcome
from rtf.testing.verdict import Verdict

OUTCOME = Outcome(
    test="JointSweep",
    robot="icub",
    unit=3,
    seed=7,
    fault="encoder_drift",
    joint="l_elbow",
    severity=0.5,
    verdict=Verdict.FAILED,
    named="l_elbow",
    attempts=1,
    seconds=4.5,
    processor_seconds=3.2,
    measurements={"l_elbow/drift": Measured(0.4, "deg", None, 0.3)},
)


def test_an_outcome_crosses_processes_unchanged():
    """It can be sent from a worker to the client, and is the same there."""
    assert pickle.loads(pickle.dumps(OUTCOME)) == OUTCOME


def test_an_outcome_cannot_be_changed():
    """What was measured stays."""
    with pytest.raises(dataclasses.FrozenInstanceError):
        OUTCOME.verdict = Verdict.PASSED  # type: ignore[misc]


def test_a_robot_without_a_fault_is_healthy():
    """The kind of the fault decides, not its size, which some kinds do not have."""
    assert not OUTCOME.healthy
    assert not dataclasses.replace(OUTCOME, severity=None).healthy
    assert dataclasses.replace(OUTCOME, fault=None, joint=None, severity=None).healthy
