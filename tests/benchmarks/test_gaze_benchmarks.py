"""The benchmark of the gaze controller, on a few points."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("run_gaze_benchmarks.py")


@pytest.mark.skipif(not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'")
def test_every_figure_is_there() -> None:
    """A row for each kind of motion, and for each reflex."""
    command = [sys.executable, str(SCRIPT), "--points", "2"]
    ran = subprocess.run(command, text=True, capture_output=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")
    for name in ("2 points, with saccades", "2 points, without saccades", "20 deg/s, gyroscope", "20 deg/s, no reflex"):
        assert name in ran.stdout
