"""Comparisons with limits: NaN is never within limits, and never a limit."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from harness import run_suite
from rtf.bottle import Bottle
from rtf.robot_testing.judging.checked_values import CheckedValue, judge_values
from rtf.testing import Parameter, TestCase
from rtf.testing.measurement import Unit
from rtf.testing.session import Session
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.testing.events import Event

#: Calls that compare a value with a lower and an upper limit, in a unit; a test fails when the value is outside.
Comparison = Callable[[TestCase, float, float, float, str], object]

NUMBERS = st.floats(allow_nan=False) | st.integers(-1000, 1000).map(float)
UNITS = st.sampled_from([str(unit) for unit in Unit])


class Case(TestCase):
    """A test with an empty body."""

    def run(self) -> None:
        """Do nothing."""


def by_parameter(case: TestCase, value: float, low: float, high: float, symbol: str) -> None:
    """Check the value as that of a parameter in a suite."""
    parameter = Parameter(list[float], "x", unit=symbol, low=low, high=high)
    try:
        parameter.convert(Bottle([value]))
    except ValueError as error:
        case.check_fail_if_true(True, str(error))


BETWEEN: dict[str, Comparison] = {
    "assert_within": lambda case, value, low, high, symbol: case.assert_within(value, low, high, symbol),
    "check_within": lambda case, value, low, high, symbol: case.check_within(value, low, high, symbol),
    "measure": lambda case, value, low, high, symbol: case.measure("x", value, symbol, low, high),
    "judge_values": lambda case, value, low, high, symbol: judge_values(
        case, "joint", [CheckedValue("x", value, symbol, high=high, low=low, hint="x")]
    ),
    "a parameter": by_parameter,
}
NEAR: dict[str, Comparison] = {
    "assert_near": lambda case, value, expected, tolerance, symbol: case.assert_near(
        value, expected, tolerance, symbol
    ),
    "check_near": lambda case, value, expected, tolerance, symbol: case.check_near(value, expected, tolerance, symbol),
    "assert_vector_near": lambda case, value, expected, tolerance, symbol: case.assert_vector_near(
        [expected, value], [expected, expected], [tolerance, tolerance], symbol
    ),
    "check_vector_near": lambda case, value, expected, tolerance, symbol: case.check_vector_near(
        [value], [expected], tolerance, symbol
    ),
}


def holds(compare: Comparison, value: float, one: float, other: float, symbol: str) -> bool:
    """Return whether a test with this comparison passes; an author's error is raised."""
    sent: list[Event] = []
    case = Case()
    session = Session("s/t", sent.append, folder="", run_folder="")
    case.attach_to(session, "")
    try:
        compare(case, value, one, other, symbol)
    except AssertionError:
        return False
    return session.tally.failures == 0


@pytest.mark.parametrize("name", BETWEEN)
@given(NUMBERS, NUMBERS, NUMBERS, UNITS)
def test_a_value_holds_exactly_between_its_limits(name: str, value: float, low: float, high: float, symbol: str):
    """Limits are inclusive, infinite ones are valid, and units make no difference."""
    assert holds(BETWEEN[name], value, low, high, symbol) == (low <= value <= high)


@pytest.mark.parametrize("name", NEAR)
@given(NUMBERS, st.integers(-1000, 1000).map(float), st.integers(-1000, 1000).map(float), UNITS)
def test_a_value_is_near_exactly_within_its_tolerance(
    name: str, value: float, expected: float, tolerance: float, symbol: str
):
    """A tolerance is inclusive, and its sign is ignored."""
    within = expected - abs(tolerance) <= value <= expected + abs(tolerance)
    assert holds(NEAR[name], value, expected, tolerance, symbol) == within


@pytest.mark.parametrize("name", [*BETWEEN, *NEAR])
@given(NUMBERS, st.floats(0, 1e9), UNITS)
def test_what_is_no_number_fails(name: str, one: float, other: float, symbol: str):
    """NaN fails every comparison."""
    if name in NEAR and math.isinf(one):
        one = 0.0
    assert not holds({**BETWEEN, **NEAR}[name], math.nan, one, other, symbol)


@pytest.mark.parametrize("name", [*BETWEEN, *NEAR])
@given(st.floats(), NUMBERS, st.booleans(), UNITS)
def test_a_limit_that_is_no_number_is_the_authors_error(
    name: str,
    value: float,
    number: float,
    first: bool,
    symbol: str,
):
    """NaN as a limit raises ValueError, whatever the value."""
    limits = (math.nan, number) if first else (number, math.nan)
    with pytest.raises(ValueError, match=r"is nan: a limit has to be a number"):
        holds({**BETWEEN, **NEAR}[name], value, *limits, symbol)


@pytest.mark.parametrize("value", [0.0, math.nan])
def test_one_limit_alone_and_the_width_of_a_margin_have_to_be_numbers(value: float):
    """NaN as the only limit, or as marginal width, raises ValueError."""
    case = Case()
    case.attach_to(Session("s/t", lambda _: None, folder="", run_folder=""), "")
    for limits in ({"low": math.nan}, {"high": math.nan}, {"high": 1.0, "marginal": math.nan}):
        with pytest.raises(ValueError, match=f"{[*limits][-1]} is nan"):
            case.measure("x", value, **limits)


def test_a_time_out_has_to_be_a_number(tmp_path: Path):
    """NaN as a time-out is an error of the test, and its body does not run."""
    code = "from rtf.testing import TestCase\nclass T(TestCase):\n    timeout = float('nan')\n    def run(self): pass\n"
    outcome = run_suite(tmp_path, "<test>t.py</test>", t__py=code)
    (test,) = outcome.results.tests.values()
    assert test.verdict is Verdict.ERROR
    assert test.last is not None
    assert "timeout is nan" in test.last.detail


def test_a_late_test_does_not_hide_a_limit_that_is_no_number():
    """A limit NaN is an error also where the value is excused."""
    case = Case()
    case.attach_to(Session("s/t", lambda _: None, folder="", run_folder=""), "")
    with pytest.raises(ValueError, match="the upper bound of delay is nan"):
        judge_values(case, "joint", [CheckedValue("delay", 1.0, "s", high=math.nan)], late="it came too late")
