"""Measurements: units, limits and margins."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.testing.measurement import Measurement, MeasurementVerdict, Unit, limits_text, margin_of, quantity, unit

FINITE = st.floats(-1e6, 1e6)


@pytest.mark.parametrize(
    ("value", "low", "high", "marginal", "verdict"),
    [
        (5, None, None, None, "recorded"),
        (5, 5, 5, None, "passed"),
        (4.999, 5, None, None, "failed"),
        (5.001, None, 5, None, "failed"),
        (5.5, 5, 10, 1, "marginal"),
        (9.5, 5, 10, 1, "marginal"),
        (6, 5, 10, 1, "passed"),
        (math.nan, 0, 1, None, "failed"),
        (math.nan, None, None, None, "recorded"),
        (math.inf, 0, None, None, "passed"),
        (math.inf, None, 1, None, "failed"),
    ],
)
def test_where_a_value_lies(value: float, low: float | None, high: float | None, marginal: float | None, verdict: str):
    """Limits are inclusive, the marginal zone is within them, and NaN is never within limits."""
    assert Measurement("x", value, Unit.MM, low, high, marginal).verdict == verdict


@given(FINITE, FINITE, FINITE)
def test_margin_is_negative_outside_and_only_there(value: float, one: float, other: float):
    """The margin is the distance to the nearest limit, negative outside."""
    low, high = min(one, other), max(one, other)
    margin = margin_of(value, low, high)
    assert margin is not None
    assert (margin >= 0) == (low <= value <= high)
    verdict = Measurement("x", value, low=low, high=high).verdict
    assert (verdict is MeasurementVerdict.PASSED) == (margin >= 0)


def test_unit_that_is_not_known_names_the_nearest():
    """The error about an unknown unit names the nearest or the known ones."""
    assert unit("deg/s") is Unit.DEG_PER_S
    assert unit("") is Unit.NONE
    with pytest.raises(ValueError, match=r"unknown unit 'degs': did you mean deg"):
        unit("degs")
    with pytest.raises(ValueError, match=r"known units are deg, rad"):
        unit("furlong")


def test_sentences_for_people():
    """The text of a measurement has value, limits, margin and unit."""
    assert str(Measurement("gap", 3, Unit.MM, high=2)) == "gap = 3 mm, expected at most 2 mm, margin -1 mm"
    assert str(Measurement("gap", 3, Unit.MM)) == "gap = 3 mm"
    assert str(Measurement("load", math.nan, Unit.PERCENT, low=0)) == "load = nan%, expected at least 0 %"
    assert limits_text(1, 3, "deg") == "within [1, 3] deg"
    assert limits_text(None, None) == "without limits"
    assert quantity(0.1 + 0.2, "s") == "0.3 s"
