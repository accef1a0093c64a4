"""The benchmark of hostile callers runs, and its bound holds for a few of them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).with_name("run_hostile_benchmarks.py")


def test_everything_comes_back() -> None:
    """Memory is bounded, and no thread or descriptor is left; otherwise it ends with an error."""
    command = [sys.executable, str(SCRIPT), "--conversations", "300"]
    ran = subprocess.run(command, text=True, capture_output=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")
    assert ran.stdout.startswith("300 damaged conversations")
