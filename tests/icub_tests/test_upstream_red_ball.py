"""``demoRedBall-icubSim.xml`` of icub-tests: its fixture starts a simulator, tracker and demonstration of ours."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from rtf.simulator.errors import RenderingError
from rtf.simulator.rendering import rendering_back_end
from rtf.testing.events import Measured
from rtf.testing.verdict import Verdict
from upstream_runs import run_upstream

PAGE = Path(__file__).parents[2] / "docs" / "red-ball.md"
#: In the form of that of the original demonstration, with its values; one hand.
CONFIGURATION = "[general]\nreach_tol 0.04\nleft_arm on\nright_arm off\n[home_arm]\nposs (-30 30 0 45 0 0 0)\n"


def test_the_suite_passes_with_the_table_of_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Eyes, gaze and the hand come to the ball."""
    try:
        rendering_back_end()
    except RenderingError as error:
        pytest.skip(str(error))
    (table,) = re.findall(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    context = tmp_path / "contexts" / "demoRedBall"
    context.mkdir(parents=True)
    (context / "config-test.ini").write_text(CONFIGURATION)
    outcome = run_upstream(tmp_path, monkeypatch, "demoRedBall-icubSim.xml", table, limit=280.0)
    assert [test.verdict for test in outcome.results.tests.values()] == [Verdict.PASSED], (
        outcome.stderr + outcome.stdout
    )
    distances = [event.value for event in outcome.of(Measured, name="distance of the left hand")]
    assert len(distances) == 1
    assert distances[0] <= 0.04
