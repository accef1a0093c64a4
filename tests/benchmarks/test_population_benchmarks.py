"""The benchmark of the population: its suites, and its table of false alarms."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import pytest

from rtf.testing.plan import load_files
from rtf.testing.verdict import Verdict


@pytest.fixture
def benchmark(monkeypatch: pytest.MonkeyPatch):
    """The script as a module."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    return import_module("run_population_benchmarks")


def test_the_exact_interval(benchmark):
    """Values of the tables of Clopper and Pearson's bounds; without an alarm the upper one has a closed form."""
    assert benchmark.interval(10, 100) == pytest.approx((0.04900, 0.17622), abs=1e-5)
    assert benchmark.interval(1, 4) == pytest.approx((0.00631, 0.80588), abs=1e-5)
    assert benchmark.interval(0, 100) == pytest.approx((0.0, 1.0 - 0.025**0.01), abs=1e-6)
    assert benchmark.interval(100, 100) == pytest.approx((0.025**0.01, 1.0), abs=1e-6)


def test_the_battery_of_a_unit(benchmark, tmp_path: Path):
    """It can be loaded from any folder, and has the tests of the battery on a robot that is the unit."""
    file = tmp_path / "unit.xml"
    file.write_text(benchmark.suite_of_unit(benchmark.BATTERY, 7, tmp_path), encoding="utf-8")
    (own,), (nominal,) = (load_files([(one, True)], {}).suites for one in (file, benchmark.BATTERY))
    assert next(fixture.param for fixture in own.fixtures if fixture.plugin == "simulator").endswith("--unit 7")
    assert len(own.tests) == len(nominal.tests) > 50


def test_the_table(benchmark):
    """A test that was left out is no run; what the guard stops is counted."""
    outcome = benchmark.Outcome
    units = {
        1: {"s/good": outcome(Verdict.PASSED, ""), "s/bad": outcome(Verdict.FAILED, "too much", 2)},
        2: {"s/good": outcome(Verdict.SKIPPED, ""), "s/bad": outcome(Verdict.INCONCLUSIVE, "busy")},
    }
    good, bad, everything = benchmark.table(units).splitlines()[2:]
    assert good == "| good | 1 | 0 | 0.0% to 97.5% | 0 | 0 |"
    assert bad == "| bad | 2 | 1 | 1.3% to 98.7% | 1 | 2 |"
    assert everything.startswith("| all | 3 | 1 | 0.8% to")
