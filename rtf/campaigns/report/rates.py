"""Rates with exact intervals."""

from __future__ import annotations

from dataclasses import dataclass

from scipy.special import betaincinv

#: The confidence of all intervals of the report.
CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Rate:
    """How many of some trials, as a share, and the interval in which the true share is expected.

    ``share`` is None without trials, and the interval then 0 to 1: nothing is known.
    """

    count: int
    trials: int
    share: float | None
    low: float
    high: float


def exact_rate(count: int, trials: int, confidence: float = CONFIDENCE) -> Rate:
    """Return the rate with the interval of C. J. Clopper and E. S. Pearson (Biometrika 26, 1934).

    It holds the true share in at least the share ``confidence`` of all campaigns, for any number of trials. Raises
    ValueError unless ``0 <= count <= trials``.
    """
    if not 0 <= count <= trials:
        raise ValueError(f"{count} of {trials} is no rate")
    tail = (1.0 - confidence) / 2.0
    low = float(betaincinv(count, trials - count + 1, tail)) if count else 0.0
    high = float(betaincinv(count + 1, trials - count, 1.0 - tail)) if count < trials else 1.0
    return Rate(count, trials, count / trials if trials else None, low, high)
