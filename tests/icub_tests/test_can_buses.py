"""Robot tests on a robot whose boards are on CAN buses: some of the suite ``bus``; the demonstration runs all."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from harness import run_command
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    import pytest

SUITE = Path(__file__).parents[2] / "suites" / "icubSim" / "bus.xml"


def test_a_healthy_robot_passes(tmp_path_factory: pytest.TempPathFactory):
    """Commands and measurements go through control board, driver, bus and firmware, and the verdicts are the same."""
    folder = tmp_path_factory.mktemp("bus")
    outcome = run_command(folder, "--suite", str(SUITE), "-k", "moves or references", limit=240.0)
    for test in ("moves-torso", "references-torso"):
        assert outcome.verdict(test) is Verdict.PASSED, outcome.stdout
