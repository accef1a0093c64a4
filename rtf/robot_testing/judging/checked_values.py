"""Measured values of a joint with their bounds, and the finding that a value out of bounds points to."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from rtf.robot_testing.judging.failure_causes import likely_causes
from rtf.testing.measurement import require_limits

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.testing import TestCase


class CheckedValue(NamedTuple):
    """A measured value with its bounds; NaN if it is missing. Without bounds it is only recorded.

    A bound must not be NaN; it is infinite if there is none. ``finding`` selects the likely causes of a value above its
    bound; ``hint`` is the failure text instead.
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
        """Whether the value is out of bounds, or missing."""
        return not self.low <= self.value <= self.high

    def scaled(self, factor: float, symbol: str) -> CheckedValue:
        """Return the value in another unit."""
        return self._replace(value=self.value * factor, high=self.high * factor, low=self.low * factor, symbol=symbol)

    @property
    def text(self) -> str:
        """The value for a message."""
        if math.isnan(self.value):
            return f"there is no {self.name}"
        return f"{self.name} is {self.value:.3g} {self.symbol}"


def judge_values(test: TestCase, name: str, values: Sequence[CheckedValue], late: str = "") -> None:
    """Record the values of the joint ``name``; a value out of bounds, or a missing one, fails the test.

    ``late`` says how the test did not keep up with the robot. With it a wrong value is no fault of the robot: the
    values are recorded without bounds, and the test ends as inconclusive.
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


def _judge(test: TestCase, name: str, value: CheckedValue) -> None:
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
        hint = f"{name}: {value.text}, more than {high:g} {value.symbol}; {causes}"
    test.measure(value.name, value.value, value.symbol, low=low, high=high, hint=hint)
