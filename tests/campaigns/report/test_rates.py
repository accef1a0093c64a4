"""Exact intervals of rates."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.campaigns.report.rates import exact_rate


@st.composite
def counts(draw: st.DrawFn) -> tuple[int, int]:
    """Some of some trials."""
    trials = draw(st.integers(0, 500))
    return draw(st.integers(0, trials)), trials


@given(counts())
def test_the_interval_has_the_share_in_it(rate: tuple[int, int]):
    """It is a part of 0 to 1, is all of it without trials, and reaches the end when all or none count."""
    found = exact_rate(*rate)
    count, trials = rate
    assert 0.0 <= found.low <= found.high <= 1.0
    if not trials:
        assert (found.share, found.low, found.high) == (None, 0.0, 1.0)
    else:
        assert found.low <= count / trials <= found.high
        assert (found.low == 0.0) is (count == 0)
        assert (found.high == 1.0) is (count == trials)


@given(counts().filter(lambda rate: 0 < rate[0] < rate[1]))
def test_the_ends_are_where_the_count_becomes_unlikely(rate: tuple[int, int]):
    """At the lower end so many or more have a chance of 2.5 %, at the upper end so many or fewer."""
    from scipy.stats import binom  # here and below, as each process that collects tests would load it for a second

    count, trials = rate
    found = exact_rate(count, trials)
    assert binom.sf(count - 1, trials, found.low) == pytest.approx(0.025, rel=1e-6)
    assert binom.cdf(count, trials, found.high) == pytest.approx(0.025, rel=1e-6)


@pytest.mark.parametrize("truth", [0.003, 0.05, 0.5, 0.97])
@pytest.mark.parametrize("trials", [5, 40])
def test_it_covers_the_truth(truth: float, trials: int):
    """Over all counts that may come, the interval has the true share in it at least 95 times of 100."""
    from scipy.stats import binom

    intervals = [exact_rate(count, trials) for count in range(trials + 1)]
    inside = np.array([one.low <= truth <= one.high for one in intervals])
    assert (binom.pmf(np.arange(trials + 1), trials, truth) * inside).sum() >= 0.95


def test_more_than_all_is_refused():
    """A count that cannot be is an error of the caller."""
    with pytest.raises(ValueError, match="4 of 3 is no rate"):
        exact_rate(4, 3)
