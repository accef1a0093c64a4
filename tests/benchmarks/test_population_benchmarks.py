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


def test_the_interval_of_wilson(benchmark):
    """Ten of a hundred, and none: the rule of three is near the upper limit then."""
    assert benchmark.interval(10, 100) == pytest.approx((0.0552, 0.1744), abs=1e-4)
    assert benchmark.interval(0, 100) == pytest.approx((0.0, 0.0370), abs=1e-4)


def test_the_battery_of_a_unit(benchmark, tmp_path: Path):
    """It can be loaded from any folder, and has the tests of the battery on a robot that is the unit."""
    file = tmp_path / "unit.xml"
    file.write_text(benchmark.suite_of_unit(benchmark.BATTERY, 7, tmp_path), encoding="utf-8")
    (own,), (nominal,) = (load_files([(one, True)], {}).suites for one in (file, benchmark.BATTERY))
    assert next(fixture.param for fixture in own.fixtures if fixture.plugin == "simulator").endswith("--unit 7")
    assert len(own.tests) == len(nominal.tests) > 50


def test_the_table(benchmark):
    """Tests without false alarms are in the last line only."""
    units = {
        1: {"s/good": benchmark.Outcome(Verdict.PASSED, ""), "s/bad": benchmark.Outcome(Verdict.FAILED, "too much")},
        2: {"s/good": benchmark.Outcome(Verdict.PASSED, ""), "s/bad": benchmark.Outcome(Verdict.INCONCLUSIVE, "busy")},
    }
    *_, bad, everything = benchmark.table(units).splitlines()
    assert bad.startswith("| bad | 2 | 1 | 50.00% | 9.45% to 90.55% | 1 |")
    assert everything.startswith("| all | 4 | 1 | 25.00% |")
