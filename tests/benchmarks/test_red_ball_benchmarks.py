"""The benchmark of the red ball, at a few places."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from rtf.simulator.errors import RenderingError
from rtf.simulator.rendering import rendering_back_end

SCRIPT = Path(__file__).with_name("run_red_ball_benchmarks.py")


def test_every_figure_is_there() -> None:
    """With noise, too."""
    try:
        rendering_back_end()
    except RenderingError as error:
        pytest.skip(str(error))
    command = [sys.executable, str(SCRIPT), "--places", "5", "--noise", "3"]
    ran = subprocess.run(command, text=True, capture_output=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")
    for name in ("with both eyes", "by its size in an eye", "not seen by an eye", "a picture takes"):
        assert f"{name}" in ran.stdout
