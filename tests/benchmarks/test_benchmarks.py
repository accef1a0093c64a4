"""The benchmarks themselves run; what they measure here means nothing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).with_name("run_benchmarks.py")


def test_the_benchmarks_run_with_tiny_counts():
    """Each benchmark comes to its end and prints a line for each of its commands."""
    ran = subprocess.run(
        [sys.executable, str(SCRIPT), "--rounds", "1", "--tests", "2"], check=True, text=True, capture_output=True
    )
    lines = ran.stdout.splitlines()
    assert [line for line in lines if not line.startswith(" ")] == [
        "Start",
        "2 trivial tests",
        "Tests of 100 events each, all reporters",
    ]
    assert sum(line.endswith(" s") or " s" in line for line in lines if line.startswith("  ")) == 10
    assert any(line.split()[:2] == ["testrunner,", "a"] and "x pytest" in line for line in lines)
