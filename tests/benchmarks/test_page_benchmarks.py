"""The benchmarks of the live page themselves run; what they measure here means nothing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).with_name("run_page_benchmarks.py")


def test_the_benchmarks_run_with_tiny_counts():
    """Each comes to its end, every client to the end of its run, and each command has its line."""
    ran = subprocess.run(
        [sys.executable, str(SCRIPT), "--rounds", "1", "--tests", "2", "--events", "20"],
        check=True,
        text=True,
        capture_output=True,
    )
    lines = ran.stdout.splitlines()
    assert [line for line in lines if not line.startswith(" ")] == [
        "Start with the page",
        "2 tests of 20 events each, followed live",
    ]
    assert sum(" s" in line for line in lines if line.startswith("  ")) == 7
