"""The benchmark of inverse kinematics, on a few poses, with what every developer has installed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).with_name("run_kinematics_benchmarks.py")


def test_every_figure_is_there() -> None:
    """A row for each library, one that is not installed, and targets out of reach."""
    command = [sys.executable, str(SCRIPT), "--targets", "3", "--solvers", "daqp,slsqp,least_squares,pink"]
    ran = subprocess.run(command, text=True, capture_output=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")
    assert "left_arm 2.0, 10 joints, 3 poses within reach" in ran.stdout
    for name in ("daqp", "slsqp", "least_squares", "pink"):
        assert f"\n{name} " in ran.stdout
    assert "half a metre further: " in ran.stdout
