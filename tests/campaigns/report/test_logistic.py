"""The logistic curve and its region, against simulated truth."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.special import expit

from rtf.campaigns.report.logistic import fit_logistic

X = np.linspace(-2.0, 2.0, 7)


def drawn(random: np.random.Generator, intercept: float, slope: float, trials: int) -> np.ndarray:
    """Return how many of the trials were found at each x, by this true curve."""
    return random.binomial(trials, expit(intercept + slope * X)).astype(float)


@pytest.mark.parametrize(("intercept", "slope"), [(1.0, 1.0), (-0.5, 3.0)])
def test_intervals_cover_the_truth(intercept: float, slope: float):
    """In about 95 of 100 campaigns the band at an x, and the interval of the place of 90 %, have the truth in them."""
    random = np.random.default_rng(7)
    trials = np.full(len(X), 15.0)
    truth = (np.log(9.0) - intercept) / slope
    fits = [fit_logistic(X, drawn(random, intercept, slope, 15), trials) for _ in range(120)]
    known = [fit for fit in fits if fit is not None]
    assert len(known) > 110
    share = expit(intercept + slope * 0.5)
    bands = [fit.shares(np.array([0.5])) for fit in known]
    inside = np.mean([low[0] <= share <= high[0] for _, low, high in bands])
    places = [fit.reaches(0.9) for fit in known]
    around = np.mean([low <= truth and (high is None or truth <= high) for _, low, high in places])
    assert 0.9 <= inside <= 0.995
    assert 0.9 <= around <= 0.995


def test_it_becomes_the_truth():
    """With many runs the curve is the true one, and the band narrow."""
    trials = np.full(len(X), 1e7)
    fit = fit_logistic(X, trials * expit(0.5 + 2.0 * X), trials)
    assert fit is not None
    assert (fit.intercept, fit.slope) == (pytest.approx(0.5, abs=1e-6), pytest.approx(2.0, abs=1e-6))
    shares, low, high = fit.shares(X)
    assert np.all((high - low) < 1e-3)
    assert shares == pytest.approx(expit(0.5 + 2.0 * X), abs=1e-6)


COUNTS = arrays(float, len(X), elements=st.integers(0, 12).map(float))


@given(COUNTS, st.floats(1e-3, 1e3), st.floats(-1e3, 1e3))
def test_any_counts_have_a_curve_or_none(found: np.ndarray, scale: float, shift: float):
    """Whatever was found, at whatever scale: no error, the band is around the curve, and the scale does not matter."""
    trials = np.full(len(X), 12.0)
    fit = fit_logistic(X * scale + shift, found, trials)
    plain = fit_logistic(X, found, trials)
    assert (fit is None) is (plain is None)
    if fit is None or plain is None:
        caught, missed = X[found > 0], X[found < 12]
        assert not len(caught) or not len(missed) or caught.min() >= missed.max() or caught.max() <= missed.min()
        return
    shares, low, high = fit.shares(X * scale + shift)
    assert np.all((low <= shares) & (shares <= high))
    assert shares == pytest.approx(plain.shares(X)[0], abs=1e-4)
    if fit.slope > 0:
        place, least, most = fit.reaches(0.99)
        assert least <= place
        assert most is None or place <= most
    else:
        with pytest.raises(ValueError, match="does not rise"):
            fit.reaches(0.99)


@pytest.mark.parametrize(
    "found", [[0, 0, 0, 0, 0, 0, 0], [9, 9, 9, 9, 9, 9, 9], [0, 0, 0, 9, 9, 9, 9], [0, 0, 0, 4, 9, 9, 9]]
)
def test_separation_is_reported(found: list[int]):
    """All, none, a clean step, and a step with one mixed level have no most likely curve."""
    assert fit_logistic(X, np.array(found, float), np.full(7, 9.0)) is None


def test_levels_that_were_not_tried_do_not_count():
    """A level without trials changes nothing."""
    trials = np.array([9.0, 9.0, 9.0, 0.0, 9.0, 9.0, 9.0])
    found = np.array([1.0, 2.0, 5.0, 0.0, 6.0, 8.0, 9.0])
    kept = trials > 0
    one, other = fit_logistic(X, found, trials), fit_logistic(X[kept], found[kept], trials[kept])
    assert one is not None
    assert other is not None
    assert (one.intercept, one.slope) == (other.intercept, other.slope)
