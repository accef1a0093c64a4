"""Least squares without the states that do not belong: a model that is linear in its coefficients."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot_testing.judging.statistics import NORMAL

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray

#: States farther from the model than this number of standard deviations do not belong; rounds of leaving them out.
_OUTLYING, _ROUNDS = 4.0, 4


class RobustFit(NamedTuple):
    """The coefficients of a model, the standard deviation of its states, and which of them belong to it."""

    values: FloatArray
    noise: float
    inside: NDArray[np.bool_]


def robust_fit(columns: FloatArray, values: FloatArray) -> RobustFit:
    """Fit ``values`` by ``columns`` (states, coefficients), leaving out the states that are far from the model."""
    inside = np.ones(len(values), dtype=bool)
    found, noise = np.zeros(columns.shape[1]), math.inf
    for _ in range(_ROUNDS):
        found = np.linalg.lstsq(columns[inside], values[inside], rcond=None)[0].astype(np.float64)
        away = np.abs(values - columns @ found)
        noise = NORMAL * float(np.median(away))
        inside = away <= max(_OUTLYING * noise, 1e-9)
    return RobustFit(found, noise, inside)
