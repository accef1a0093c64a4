"""The logistic curve of a share that grows with a quantity, by maximum likelihood, with its 95 % region.

Shares are modelled as ``1 / (1 + exp(-(intercept + slope * x)))``. The region is that of the profile likelihood: all
curves whose log-likelihood is at most 1.92 (half the 95 % quantile of chi-squared with one degree of freedom) below
the greatest. It is convex, because the log-likelihood is concave, so that the interval of every linear function of the
two parameters, such as the band at one ``x``, is reached on its boundary: one boundary gives all intervals.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri, expit, logit

from rtf.campaigns.report.rates import CONFIDENCE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Numbers = NDArray[np.float64]

_DROP = float(chdtri(1, 1.0 - CONFIDENCE)) / 2.0
#: Directions from the best curve in which the boundary is looked for. Between two of them it is missed by 0.1 % of its
#: width.
_DIRECTIONS = 72
_HALVINGS = 30
_DOUBLINGS = 60


@dataclass(frozen=True, slots=True)
class Logistic:
    """The best curve, and curves on the boundary of its region: rows of intercept and slope."""

    intercept: float
    slope: float
    boundary: Numbers

    def shares(self, x: Numbers) -> tuple[Numbers, Numbers, Numbers]:
        """Return the share at each ``x``, and the ends of its 95 % interval."""
        ends = self.boundary[:, :1] + self.boundary[:, 1:] * x
        return expit(self.intercept + self.slope * x), expit(ends.min(axis=0)), expit(ends.max(axis=0))

    def reaches(self, share: float) -> tuple[float, float, float | None]:
        """Return where the curve reaches a share, and the ends of the 95 % interval of this place.

        The upper end is None if curves that do not rise are in the region: then no ``x`` is great enough. Raises
        ValueError if the best curve itself does not rise.
        """
        if self.slope <= 0.0:
            raise ValueError("the curve does not rise")
        wanted = float(logit(share))
        rising = self.boundary[self.boundary[:, 1] > 0.0]
        places = (wanted - rising[:, 0]) / rising[:, 1]
        bounded = len(rising) == len(self.boundary)
        best = (wanted - self.intercept) / self.slope
        return best, min(best, float(places.min())), max(best, float(places.max())) if bounded else None


def fit_logistic(x: Numbers, found: Numbers, trials: Numbers) -> Logistic | None:
    """Return the curve of ``found`` of ``trials`` at each ``x``; None if none is the most likely one.

    That is so when a value of ``x`` separates the found from the others, or when all or none were found: the steeper
    the curve, the more likely it is, without end (A. Albert and J. A. Anderson, Biometrika 71, 1984).
    """
    tried = trials > 0
    x, found, trials = x[tried], found[tried], trials[tried]
    missed = trials - found
    if not _overlap(x[found > 0], x[missed > 0]):
        return None
    centre, scale = float(np.average(x, weights=trials)), float(np.ptp(x))
    scaled = (x - centre) / scale
    best = _most_likely(scaled, found, trials)
    boundary = _boundary(best, scaled, found, trials)
    slopes = boundary[:, 1] / scale
    intercepts = boundary[:, 0] - slopes * centre
    slope = float(best[1]) / scale
    return Logistic(float(best[0]) - slope * centre, slope, np.column_stack([intercepts, slopes]))


def _overlap(found: Numbers, missed: Numbers) -> bool:
    if not len(found) or not len(missed):
        return False
    return bool(found.min() < missed.max() and missed.min() < found.max())


def _log_likelihood(parameters: Numbers, x: Numbers, found: Numbers, trials: Numbers) -> Numbers:
    """Return the log-likelihood of each row of parameters, without terms that are the same for all."""
    logits = parameters[..., :1] + parameters[..., 1:] * x
    values: Numbers = -(found * np.logaddexp(0.0, -logits) + (trials - found) * np.logaddexp(0.0, logits)).sum(axis=-1)
    return values


def _most_likely(x: Numbers, found: Numbers, trials: Numbers) -> Numbers:
    from scipy.optimize import minimize

    design = np.column_stack([np.ones_like(x), x])

    def cost(parameters: Numbers) -> tuple[float, Numbers]:
        gap = trials * expit(design @ parameters) - found
        return -float(_log_likelihood(parameters, x, found, trials)), design.T @ gap

    def curvature(parameters: Numbers) -> Numbers:
        return _information(parameters, x, trials)

    share = found.sum() / trials.sum()
    start = np.array([float(logit(share)), 0.0])
    best = minimize(cost, start, jac=True, hess=curvature, method="trust-exact", options={"gtol": 1e-9})
    result: Numbers = best.x
    return result


def _information(parameters: Numbers, x: Numbers, trials: Numbers) -> Numbers:
    design = np.column_stack([np.ones_like(x), x])
    share = expit(design @ parameters)
    return design.T @ (design * (trials * share * (1.0 - share))[:, None])


def _boundary(best: Numbers, x: Numbers, found: Numbers, trials: Numbers) -> Numbers:
    """Return where the log-likelihood has dropped, in directions that are even in the metric of the information."""
    least = _log_likelihood(best, x, found, trials) - _DROP
    angles = np.linspace(0.0, 2.0 * np.pi, _DIRECTIONS, endpoint=False)
    whitened = np.linalg.inv(np.linalg.cholesky(_information(best, x, trials))).T
    directions = np.column_stack([np.cos(angles), np.sin(angles)]) @ whitened.T

    def inside(radius: Numbers) -> NDArray[np.bool_]:
        return _log_likelihood(best + radius[:, None] * directions, x, found, trials) >= least

    outer = np.ones(_DIRECTIONS)
    for _ in range(_DOUBLINGS):
        still = inside(outer)
        if not still.any():
            break
        outer[still] *= 2.0
    inner = np.zeros(_DIRECTIONS)
    for _ in range(_HALVINGS):
        middle = (inner + outer) / 2.0
        still = inside(middle)
        inner, outer = np.where(still, middle, inner), np.where(still, outer, middle)
    boundary: Numbers = best + inner[:, None] * directions
    return boundary
