"""Robot tests on a simulated robot of YARP 4: the same tests, found by the ports that it has registered.

They are some of the suite ``yarp4``: streams, requests, modes and moves. The demonstration runs all of it.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from harness import run_command
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from harness import Outcome

SUITE = Path(__file__).parents[2] / "suites" / "icubSim" / "yarp4.xml"
TESTS = ("modes-torso", "references-torso", "moves-torso", "rates", "duplicates")


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    """One run of all of them, without any setting but that of the robot."""
    chosen = "modes or references or moves or rates or duplicates"
    return run_command(tmp_path_factory.mktemp("yarp4"), "--suite", str(SUITE), "-k", chosen, limit=240.0)


@pytest.mark.parametrize("test", TESTS)
def test_it_passes(outcome: Outcome, test: str):
    """A healthy robot of YARP 4 passes as one of YARP 3 does."""
    assert outcome.verdict(test) is Verdict.PASSED, outcome.stdout


def test_it_was_a_robot_of_yarp_4(outcome: Outcome):
    """The robot had the ports of YARP 4 and no other."""
    assert any("/icubSim/torso: nws/rpc:i command:i" in str(event) for event in outcome.events)
