"""The little statistics that verdicts and trends need. NumPy is imported when a trend is asked for."""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

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


def theil_sen(values: Sequence[float]) -> float:
    """The slope a step of finite values that follow each other: the median over all pairs (P. K. Sen, 1968).

    Up to 29 % of the values may be outliers without the slope following them. It is 0 for fewer than two values.
    """
    import numpy as np

    if len(values) < 2:  # noqa: PLR2004 - a slope has two ends
        return 0.0
    steps, differences = _pairs(values)
    with np.errstate(all="ignore"):  # the difference of two of the largest numbers is no number
        return float(np.median(differences / steps))


def mann_kendall(values: Sequence[float]) -> float:
    """How likely it is that finite values without a trend rise or fall together as much as these: a two-sided p value.

    The normal approximation with ties and continuity correction (H. B. Mann, 1945; M. G. Kendall, Rank Correlation
    Methods, 1975, chapter 4), which is good from ten values on. The values must not depend on each other.
    """
    import numpy as np

    count = len(values)
    _, differences = _pairs(values)
    score = int(np.sign(differences).sum())
    tied = sum(_spread(repeated) for repeated in Counter(values).values())
    variance = (_spread(count) - tied) / 18
    if variance <= 0 or score == 0:
        return 1.0
    return math.erfc((abs(score) - 1) / math.sqrt(2 * variance))


def _pairs(values: Sequence[float]) -> tuple[NDArray[Any], NDArray[Any]]:
    """How far apart the members of each pair stand, and by how much the later is larger; infinite if too large."""
    import numpy as np

    row = np.asarray(values, dtype=float)
    first, second = np.triu_indices(len(row), 1)
    with np.errstate(over="ignore"):
        return second - first, row[second] - row[first]


def _spread(count: int) -> int:
    return count * (count - 1) * (2 * count + 5)


def discovery_limit(p_values: Iterable[float], rate: float = 0.05) -> float:
    """The largest of many p values that may be believed, if at most this share of what is believed may be chance.

    Y. Benjamini and Y. Hochberg, 1995. Of a thousand measurements fifty have a p value below 0.05 by chance alone; this
    keeps them off a list. It is 0 when none may be believed.
    """
    ordered = sorted(p_values)
    believed = [p for rank, p in enumerate(ordered, 1) if p <= rate * rank / len(ordered)]
    return believed[-1] if believed else 0.0
