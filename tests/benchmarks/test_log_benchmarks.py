"""The benchmark of logs runs, and nothing is lost of a few records."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).with_name("run_log_benchmarks.py")


def test_nothing_is_lost() -> None:
    """Every record is in the file; otherwise it ends with an error."""
    command = [sys.executable, str(SCRIPT), "--only", "rate", "--programs", "2", "--rate", "2000", "--seconds", "0.5"]
    ran = subprocess.run(command, text=True, capture_output=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")
    assert " 0 of 1000 lost" in ran.stdout
