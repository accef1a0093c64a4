"""The benchmark of campaigns: the memory of a client does not depend on the machine; other figures are not judged."""

from __future__ import annotations

import re
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(not find_spec("distributed"), reason="needs pip install 'rtf[cluster]'")


@pytest.fixture
def benchmark(monkeypatch: pytest.MonkeyPatch):
    """The script as a module."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    return import_module("run_campaign_benchmarks")


def test_a_client_stays_small(benchmark, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """A client that takes in results needs less memory than is wanted."""
    (tmp_path / "trivial.py").write_text(benchmark.TRIVIAL)
    benchmark.measure_memory(tmp_path, 100)
    (size,) = re.findall(r"100 results: (\d+) MiB at most", capsys.readouterr().out)
    assert int(size) << 20 < benchmark.MEMORY


@pytest.mark.long
def test_a_simulated_cluster_runs_a_campaign(benchmark, capsys: pytest.CaptureFixture[str]):
    """Workers in two processes get runs from a scheduler, and the script says how well they are used."""
    benchmark.measure_scaling(3, 6, 0.1)
    assert "3 workers, 6 runs of 0.1 s" in capsys.readouterr().out
