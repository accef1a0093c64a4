"""The benchmark of reports runs, on a small campaign."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).with_name("run_campaign_report_benchmarks.py")


def test_a_small_campaign_is_reported_in_time() -> None:
    """A hundred runs, and a thousand rows, are within the limits of the large ones."""
    command = [sys.executable, str(SCRIPT), "--runs", "100", "--rows", "1000"]
    ran = subprocess.run(command, text=True, capture_output=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")
    assert ran.stdout.startswith("report of 100 runs: ")
