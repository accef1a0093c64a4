"""Judging what was measured of a joint: each value with the most that it may be, and what it points to to be more."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from rtf.robot_testing.causes import likely_causes
from rtf.testing.measurement import require_limits

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.testing import TestCase


class Judged(NamedTuple):
    """A value, NaN where there is none, with the most and the least that it may be. Without bounds it is only measured.

    A bound has to be a number; it is infinite where there is none. ``finding`` is what a value beyond its bound points
    to; or ``hint`` says what it means to be out of bounds.
    """

    name: str
    value: float
    symbol: str
    high: float = math.inf
    finding: str = ""
    low: float = -math.inf
    hint: str = ""

    @property
    def wrong(self) -> bool:
        """Whether it is too much, or too little, or not there."""
        return not self.low <= self.value <= self.high

    @property
    def text(self) -> str:
        """The value in words."""
        if math.isnan(self.value):
            return f"there is no {self.name}"
        return f"{self.name} is {self.value:.3g} {self.symbol}"


def judge_values(test: TestCase, name: str, values: Sequence[Judged], late: str = "") -> None:
    """Measure values of a joint of that ``name``; what is beyond its bound, or is not there, fails the test.

    ``late`` says how the test did not keep up with the robot. Then what is wrong is not held against the robot: the
    values are measured without bounds, and the test ends as inconclusive.
    """
    for value in values:
        require_limits(
            **{f"the lower bound of {value.name}": value.low, f"the upper bound of {value.name}": value.high}
        )
    if late and any(value.wrong for value in values):
        for value in values:
            if not math.isnan(value.value):
                test.measure(value.name, value.value, value.symbol)
        test.inconclusive(f"{name}: {', '.join(value.text for value in values if value.wrong)}; but {late}")
    for value in values:
        _judge(test, name, value)


def _judge(test: TestCase, name: str, value: Judged) -> None:
    if math.isnan(value.value):
        causes = likely_causes(value.finding) if value.finding else ""
        why = "; ".join(text for text in (f"{name}: {value.text}", value.hint or causes) if text)
        test.check_fail_if_true(condition=True, text=why)
        return
    low = None if value.low == -math.inf else value.low
    high = None if value.high == math.inf else value.high
    hint = value.hint
    if high is not None and not hint:
        causes = likely_causes(value.finding)
        hint = f"{name}: {value.text}, it is to be {high:g} {value.symbol} at most; {causes}"
    test.measure(value.name, value.value, value.symbol, low=low, high=high, hint=hint)
