"""The benchmark of the guard itself runs; a few of its trials reach their goals."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("run_guard_benchmarks.py")


@pytest.mark.skipif(not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'")
def test_blocked_joints_are_measured():
    """A row for each mode, all of them stopped, and within the goal: in lockstep the machine does not matter."""
    words = [sys.executable, str(SCRIPT), "blocks", "--parts", "torso", "--joints", "1", "--places", "1"]
    title, heads, *rows, goal = subprocess.run(words, check=True, text=True, capture_output=True).stdout.splitlines()
    assert title.startswith("Blocked joints")
    assert heads.split()[-2:] == ["not", "stopped"]
    assert [(row.split()[0], row.split()[-1]) for row in rows] == [
        (mode, "0") for mode in ("pos", "vel", "posd", "torq")
    ]
    assert goal == "  goal: 0.5 s; 4 of 4 reach it"
