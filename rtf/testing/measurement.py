"""A measured value with its unit and limits, and its place between them; and the uncertainty of a measured pass rate.

Units are a small closed set with exact symbols: robot tests need two dozen, and reports compare them as strings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

#: The standard normal quantile for 95 % two-sided confidence.
_Z95 = 1.959963984540054


class Unit(StrEnum):
    """The units of the framework. Angles are degrees everywhere at a robot's surface."""

    NONE = ""
    DEG = "deg"
    RAD = "rad"
    DEG_PER_S = "deg/s"
    DEG_PER_S2 = "deg/s^2"
    RAD_PER_S = "rad/s"
    M = "m"
    MM = "mm"
    M_PER_S = "m/s"
    M_PER_S2 = "m/s^2"
    KG = "kg"
    N = "N"
    NM = "Nm"
    NM_PER_DEG = "Nm/deg"
    NMS_PER_DEG = "Nm*s/deg"
    A = "A"
    MA = "mA"
    V = "V"
    W = "W"
    CELSIUS = "degC"
    UT = "uT"
    HZ = "Hz"
    S = "s"
    MS = "ms"
    US = "us"
    PERCENT = "%"
    COUNT = "count"
    PIXEL = "px"
    BYTE = "B"
    KIB = "KiB"
    MIB = "MiB"


def unit(symbol: str | Unit) -> Unit:
    """Return the unit with this exact symbol; a ValueError names the nearest ones and lists all."""
    try:
        return Unit(symbol)
    except ValueError:
        import difflib

        near = difflib.get_close_matches(str(symbol), [str(u) for u in Unit], n=3, cutoff=0.4)
        hint = f"did you mean {' or '.join(near)}? " if near else ""
        known = ", ".join(str(u) for u in Unit if u)
        raise ValueError(f"unknown unit {symbol!r}: {hint}known units are {known}") from None


def number(value: float) -> str:
    """Write a number for people: six significant digits, no trailing zeros."""
    return f"{value:.6g}"


def quantity(value: float, symbol: str = "") -> str:
    """Write a value with its unit, such as ``12.5 deg`` or ``80%``."""
    if symbol == Unit.PERCENT:
        return f"{number(value)}%"
    return f"{number(value)} {symbol}" if symbol else number(value)


def require_limits(**limits: float | None) -> None:
    """Refuse a limit that is not a number: nothing could ever violate it. Raises ValueError, which names the limit.

    None and the infinities are limits.
    """
    for name, limit in limits.items():
        if limit is not None and math.isnan(limit):
            raise ValueError(f"{name} is nan: a limit has to be a number, or None where there is no limit")


def margin_of(value: float, low: float | None, high: float | None) -> float | None:
    """Return the distance from ``value`` to the nearest limit: positive inside, negative outside, None if unknown.

    Raises ValueError for a limit that is not a number.
    """
    require_limits(low=low, high=high)
    if math.isnan(value):
        return None
    distances = []
    if low is not None:
        distances.append(_distance(low, value))
    if high is not None:
        distances.append(_distance(value, high))
    return min(distances) if distances else None


def _distance(lower: float, upper: float) -> float:
    """Return the distance between two limits; the difference of two equal infinities would not be a number."""
    return 0.0 if lower == upper else upper - lower


def limits_text(low: float | None, high: float | None, symbol: str = "") -> str:
    """Write limits for people, such as ``within [1, 3] deg`` or ``at most 5 ms``."""
    suffix = f" {symbol}" if symbol else ""
    if low is not None and high is not None:
        return f"within [{number(low)}, {number(high)}]{suffix}"
    if low is not None:
        return f"at least {number(low)}{suffix}"
    if high is not None:
        return f"at most {number(high)}{suffix}"
    return "without limits"


class MeasurementVerdict(StrEnum):
    """The place of a value between its limits."""

    PASSED = "passed"
    MARGINAL = "marginal"
    FAILED = "failed"
    RECORDED = "recorded"  # there were no limits


@dataclass(frozen=True, slots=True)
class Measurement:
    """A value with unit and inclusive limits; ``marginal`` is the width of the zone inside each limit that warns."""

    name: str
    value: float
    unit: Unit = Unit.NONE
    low: float | None = None
    high: float | None = None
    marginal: float | None = None

    @property
    def margin(self) -> float | None:
        """Distance to the nearest limit in the unit of the value; negative outside, None without limits."""
        return margin_of(self.value, self.low, self.high)

    @property
    def verdict(self) -> MeasurementVerdict:
        """Where the value lies. A value that is not a number never lies within limits.

        Raises ValueError for a limit that is not a number.
        """
        require_limits(low=self.low, high=self.high, marginal=self.marginal)
        if self.low is None and self.high is None:
            return MeasurementVerdict.RECORDED
        margin = self.margin
        if margin is None or margin < 0:
            return MeasurementVerdict.FAILED
        if self.marginal is not None and margin < self.marginal:
            return MeasurementVerdict.MARGINAL
        return MeasurementVerdict.PASSED

    @property
    def sentence(self) -> str:
        """The value, its limits and margin, for people."""
        text = quantity(self.value, self.unit)
        if self.low is None and self.high is None:
            return text
        text += f", expected {limits_text(self.low, self.high, self.unit)}"
        margin = self.margin
        return text if margin is None else f"{text}, margin {quantity(margin, self.unit)}"

    def __str__(self) -> str:
        return f"{self.name} = {self.sentence}"

    def members(self) -> dict[str, Any]:
        """Return the members of an event that describes the measurement, as far as they are known."""
        limits = {"low": self.low, "high": self.high, "margin": self.margin}
        given = {name: limit for name, limit in limits.items() if limit is not None}
        return {"value": self.value, "unit": str(self.unit), **given}


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
