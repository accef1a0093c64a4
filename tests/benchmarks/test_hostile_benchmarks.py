"""The benchmark of hostile callers runs, and its bound holds for a few of them."""

from __future__ import annotations

import run_hostile_benchmarks


def test_everything_comes_back() -> None:
    """Memory is bounded, and no thread or descriptor is left."""
    outcome = run_hostile_benchmarks.measure(300)
    assert outcome.gained < run_hostile_benchmarks.BOUND
    assert "300 damaged conversations" in outcome.line()
