"""The benchmarks of the page in a browser themselves run; what they measure here means nothing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).with_name("run_browser_benchmarks.py")


def test_the_benchmarks_run_with_tiny_counts():
    """Each comes to its end and prints its lines, those with a goal too."""
    counts = ("--rounds", "1", "--tests", "200", "--ticks", "3")
    ran = subprocess.run([sys.executable, str(SCRIPT), *counts], check=True, text=True, capture_output=True)
    lines = ran.stdout.splitlines()
    assert [line.partition(",")[0] for line in lines if not line.startswith(" ")] == [
        "Event to pixel",
        "Archive of 200 tests",
        "Late join of 200 tests",
    ]
    assert sum("goal" in line for line in lines) == 9
