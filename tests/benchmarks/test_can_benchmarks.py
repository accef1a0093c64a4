"""The benchmark of CAN runs, on a small robot."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).with_name("run_can_benchmarks.py")


def test_every_figure_is_there() -> None:
    """Codec, robot with and without buses, virtual bus, a part in real time, latency, and start."""
    command = [sys.executable, str(SCRIPT), "--robot", "bench", "--seconds", "0.1", "--turns", "1"]
    ran = subprocess.run(command, text=True, capture_output=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")
    assert "position: encode " in ran.stdout
    assert "x with 1 buses" in ran.stdout
    assert "virtual: " in ran.stdout
    assert "arm: 2 axes in real time, " in ran.stdout
    assert "the motor is driven after 1.00 ms" in ran.stdout
    assert "s for 5 boards" in ran.stdout
