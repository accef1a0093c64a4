"""The little statistics that verdicts need."""

from __future__ import annotations

import math

#: The standard normal quantile for 95 % two-sided confidence.
_Z95 = 1.959963984540054


def wilson_interval(successes: int, trials: int, z: float = _Z95) -> tuple[float, float]:
    """The Wilson score interval of a proportion, as fractions of 1.

    It stays inside [0, 1] and is honest for few trials and for none failing (E. B. Wilson, 1927). With no trial nothing
    is known: (0, 1).
    """
    if trials == 0:
        return 0.0, 1.0
    p = successes / trials
    denominator = 1 + z * z / trials
    centre = (p + z * z / (2 * trials)) / denominator
    half = z * math.sqrt(p * (1 - p) / trials + z * z / (4 * trials * trials)) / denominator
    return max(0.0, centre - half), min(1.0, centre + half)


def median(values: list[float]) -> float:
    """The middle value of a list that is not empty; the mean of the middle two where there are two."""
    ordered = sorted(values)
    half = len(ordered) // 2
    return ordered[half] if len(ordered) % 2 else (ordered[half - 1] + ordered[half]) / 2
