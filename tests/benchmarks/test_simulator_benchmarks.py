"""The benchmarks of the simulated robot themselves run; what they measure here means nothing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("run_simulator_benchmarks.py")


def run(*arguments: str) -> list[str]:
    """What the script prints, line by line."""
    ran = subprocess.run([sys.executable, str(SCRIPT), *arguments], check=True, text=True, capture_output=True)
    assert ran.stderr == ""
    return ran.stdout.splitlines()


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("speed", 2 * ["(wanted: 70%)"] + ["(wanted: 15)"] + 2 * ["(wanted: 70%)"] + ["(wanted: 10)"]),
        ("calls", ["(wanted: 5 us)", "(wanted: 5 us)", "(wanted: 1.2)"]),
        ("jitter", ["(wanted: p99 of 2 ms)"]),
        ("two", ["(wanted: 1.8)"]),
        ("start", ["(wanted: 1.5 s)"]),
    ],
)
def test_each_figure_stands_beside_what_is_wanted(name: str, wanted: list[str]):
    """The load of the machine comes first."""
    title, *lines = run(name, "--turns", "1")
    assert title.startswith(f"{name}, load ")
    assert [line[line.index("(wanted") :] for line in lines if "(wanted" in line] == wanted
