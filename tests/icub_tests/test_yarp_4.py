"""Robot tests on a simulated robot of YARP 4: the same tests, found by the ports that it has registered."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from harness import Outcome

    from .conftest import Runs

PART = '<parameter name="part">torso</parameter>'
TESTS = {
    "limits": f"{PART} JointLimits",
    "modes": f"{PART} ControlModes",
    "moves": f"{PART} PositionDirect",
    "references": f"{PART} MovementReferences",
    "open-loop": f"{PART} OpenLoopConsistency",
    "drift": f"{PART} OpticalEncodersDrift",
    "motor": f"{PART} MotorTest",
    "duplicates": "SensorsDuplicateReadings",
    "rates": "PortsFrequency",
}


@pytest.fixture(scope="module")
def outcome(run_on_robot: Runs) -> Outcome:
    """One run of all of them, without any setting but that of the robot."""
    rows = "".join(f'<test name="{name}"> {text} </test>' for name, text in TESTS.items())
    return run_on_robot(rows, dialect=4, parts="head,torso")


@pytest.mark.parametrize("test", TESTS)
def test_it_passes(outcome: Outcome, test: str):
    """A healthy robot of YARP 4 passes as one of YARP 3 does."""
    assert outcome.verdict(test) is Verdict.PASSED, outcome.stdout


def test_it_was_a_robot_of_yarp_4(outcome: Outcome):
    """The robot had the ports of YARP 4 and no other."""
    assert any("/icubSim/torso: nws/rpc:i command:i" in str(event) for event in outcome.events)
