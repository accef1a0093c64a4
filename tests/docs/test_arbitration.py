"""The example of arbitration: on a simulated arm, the reflex has the joint for as long as its event lasts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from harness import run_command, write_files
from rtf.testing.events import Measured

if TYPE_CHECKING:
    import pytest

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "reflex_wins.py"


def test_the_reflex_wins_for_two_seconds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Then the reach goes on; both times are simulated ones."""
    write_files(
        tmp_path,
        {
            "suite.xml": '<suite name="s"><fixture name="names"> yarpserver </fixture>'
            '<fixture name="robot" depends="names"><parameter name="parts">left_arm</parameter> simulator </fixture>'
            f'<test name="reflex"> {EXAMPLE} </test></suite>'
        },
    )
    outcome = run_command(tmp_path, "--suite", "suite.xml", limit=200.0)
    assert outcome.exit_code == 0, outcome.stdout + outcome.stderr
    (had,) = outcome.of(Measured, name="the reflex has the joint")
    assert 1.98 <= had.value <= 2.04  # type: ignore[attr-defined]
