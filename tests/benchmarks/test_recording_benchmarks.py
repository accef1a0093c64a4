"""The benchmark of recordings runs, and nothing is lost of a few messages."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).with_name("run_recording_benchmarks.py")


def test_nothing_is_lost() -> None:
    """Every message is in the recording of each format; otherwise it ends with an error."""
    command = [sys.executable, str(SCRIPT), "--streams", "3", "--cameras", "1", "--seconds", "0.5"]
    ran = subprocess.run(command, text=True, capture_output=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")
    assert ran.stdout.count(" 0 of ") == 2
