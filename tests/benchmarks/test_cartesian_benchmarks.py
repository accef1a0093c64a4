"""The benchmark of Cartesian control, on a few poses."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).with_name("run_cartesian_benchmarks.py")


def test_both_arms_have_a_table() -> None:
    """With errors, durations and speeds."""
    ran = subprocess.run([sys.executable, str(SCRIPT), "--poses", "2"], text=True, capture_output=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")
    for arm in ("left", "right"):
        assert f"{arm} arm: 2 of 2 poses done" in ran.stdout
    assert ran.stdout.count("position error, mm") == 2
