"""Everything that runs a campaign is killed in the middle; ``run_campaign_kills.py`` does it many times."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

pytestmark = pytest.mark.torture


@pytest.fixture
def main(monkeypatch: pytest.MonkeyPatch):
    """The command of the script."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    return import_module("run_campaign_kills").main


def test_local_runners_and_the_client_are_killed(main, capsys: pytest.CaptureFixture[str]):
    """Every run has one result, although runners and the client died."""
    assert main(["--backend", "local", "--runs", "6", "--workers", "1", "--clients", "1"]) == 0
    assert "6 runs, 6 results, each once, after 2 kills" in capsys.readouterr().out


@pytest.mark.skipif(not find_spec("distributed"), reason="needs pip install 'rtf[cluster]'")
def test_workers_and_scheduler_of_a_cluster_are_killed(main, capsys: pytest.CaptureFixture[str]):
    """Every run has one result, although workers and scheduler died, over connections with TLS."""
    assert main(["--runs", "5", "--workers", "1", "--schedulers", "1", "--clients", "0"]) == 0
    assert "5 runs, 5 results, each once, after 2 kills" in capsys.readouterr().out
