"""The benchmark of the robot tests itself runs; what it measures here means nothing."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("run_robot_test_benchmarks.py")


@pytest.mark.skipif(not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'")
def test_half_swings_are_timed():
    """A line with how long it took, and the runner's own verdict."""
    words = [sys.executable, str(SCRIPT), "drift", "--swings", "4"]
    (line,) = subprocess.run(words, check=True, text=True, capture_output=True).stdout.splitlines()
    assert line.split()[0] == "drift"
    assert "goal: 120 s   PASSED  1 passed" in line
