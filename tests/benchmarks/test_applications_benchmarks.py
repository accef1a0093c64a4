"""The benchmark of a node of programs runs, and its bounds hold for a few programs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).with_name("run_applications_benchmarks.py")


def test_nothing_is_left() -> None:
    """No thread, descriptor, process or name is left by starts, and watching costs little; else it exits with 1."""
    # Long enough for the clock of processor time, which counts hundredths of a second.
    command = [sys.executable, str(SCRIPT), "--starts", "5", "--programs", "3", "--seconds", "1"]
    ran = subprocess.run(command, text=True, capture_output=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")
    assert ran.stdout.startswith("5 starts: ")
