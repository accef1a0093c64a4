"""The statistics of trends, compared with definitions, exact distributions and known cases."""

from __future__ import annotations

import math
import random
import statistics
from itertools import combinations, permutations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.testing.history.trends import discovery_limit, mann_kendall, theil_sen
from rtf.testing.measurement import wilson_interval

NUMBERS = st.floats(-1e6, 1e6, allow_subnormal=False)


def score(values: list[float]) -> int:
    """Return the number of rising pairs minus that of falling pairs."""
    return sum((later > earlier) - (later < earlier) for earlier, later in combinations(values, 2))


def exact_p(values: list[float]) -> float:
    """Return the share of all orders of these values with a score at least as far from zero."""
    scores = [abs(score(order)) for order in set(permutations(values))]
    return sum(found >= abs(score(values)) for found in scores) / len(scores)


@given(st.lists(NUMBERS, min_size=2, max_size=25))
def test_the_slope_is_the_median_of_all_slopes(values: list[float]):
    """The slope is the median of the slopes of all pairs."""
    slopes = [(values[j] - values[i]) / (j - i) for i, j in combinations(range(len(values)), 2)]
    assert theil_sen(values) == pytest.approx(statistics.median(slopes), rel=1e-9, abs=1e-9)


def test_outliers_do_not_move_the_slope():
    """Outliers in a fifth of the values do not change the slope."""
    values = [3.0 + 0.25 * index for index in range(30)]
    for index in range(0, 30, 5):
        values[index] = 1e9
    assert theil_sen(values) == pytest.approx(0.25)


@pytest.mark.parametrize("values", [[], [1.0]])
def test_without_two_values_there_is_no_slope(values: list[float]):
    """Fewer than two values have slope 0 and p 1."""
    assert theil_sen(values) == 0
    assert mann_kendall(values) == 1


def test_the_largest_numbers_do_no_harm():
    """Values whose difference overflows give valid results without a warning."""
    values = [1.7e308, -1.7e308] * 6
    assert 0 <= mann_kendall(values) <= 1
    assert not math.isnan(theil_sen([-1.7e308, 1.7e308]))


def test_ten_rising_values_are_no_chance():
    """Ten rising values have the p of z = 44 / √125."""
    assert mann_kendall(list(range(10))) == pytest.approx(math.erfc(44 / math.sqrt(125) / math.sqrt(2)))
    assert mann_kendall(list(range(10))) == pytest.approx(8.303e-5, rel=1e-3)


@pytest.mark.parametrize(
    "values",
    [
        [1, 2, 3, 4, 5, 6, 7],
        [3, 1, 2, 5, 4, 7, 6],
        [7, 6, 4, 5, 3, 1, 2],
        [1, 1, 2, 2, 3, 3, 4],
        [4, 4, 4, 2, 2, 2, 1],
        [1, 2, 1, 2, 1, 2, 1],
    ],
)
def test_the_approximation_is_near_the_exact_distribution(values: list[float]):
    """For seven values p is near that of the exact distribution, with and without ties."""
    assert mann_kendall(values) == pytest.approx(exact_p(values), abs=0.05)


@given(st.lists(st.integers(-3, 3), min_size=10, max_size=30))
def test_it_matters_only_which_value_is_larger(values: list[int]):
    """The p value depends on the order of the values only, not on direction, sign or scale."""
    p = mann_kendall(values)
    assert 0 <= p <= 1
    assert p == mann_kendall(values[::-1]) == mann_kendall([-value for value in values])
    assert p == mann_kendall([1000 * value for value in values])
    assert (p == 1) == (abs(score(values)) <= 1)


def test_noise_is_taken_for_a_trend_as_often_as_promised():
    """Noise has p < 0.05 in about one case of twenty."""
    noise = random.Random(7)
    found = sum(mann_kendall([noise.gauss() for _ in range(30)]) < 0.05 for _ in range(1000))
    assert 30 <= found <= 70


@given(st.lists(st.floats(0, 1), max_size=40))
def test_the_discovery_limit_is_the_last_p_under_the_line(p_values: list[float]):
    """The limit is the largest p that is at most its rank's share of the rate."""
    ordered = sorted(p_values)
    under = [p for rank, p in enumerate(ordered, 1) if p <= 0.05 * rank / len(ordered)]
    assert discovery_limit(p_values) == (max(under) if under else 0)


def test_a_known_case_of_discoveries():
    """Of the p values of Benjamini and Hochberg (1995) four are believed at 5 %."""
    p_values = [0.0001, 0.0004, 0.0019, 0.0095, 0.0201, 0.0278, 0.0298, 0.0344, 0.0459, 0.324, 0.4262, 0.5719]
    p_values += [0.6528, 0.759, 1.0]
    assert discovery_limit(p_values) == 0.0095


def test_the_wilson_interval_of_eight_in_ten():
    """The interval of 8 in 10 is that of tables, and that of 0 in 0 is from 0 to 1."""
    assert wilson_interval(8, 10) == pytest.approx((0.4902, 0.9433), abs=1e-4)
    assert wilson_interval(0, 0) == (0, 1)
