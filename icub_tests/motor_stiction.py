"""Stiction: the duty cycle that sets each motor in motion, in both directions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot_testing import Safety, likely_causes
from rtf.robot_testing.duty_test import DutyTest, Steps
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.duty_test import BothWays

_START = 0.0  # %: a ramp begins with the duty cycle that holds the joint
_FAR = 0.5  # share of the greatest stiction


class MotorStiction(DutyTest):
    """Drives each motor with a slowly growing duty cycle until it has moved, upwards and downwards.

    The stiction is half the difference of the two duty cycles at which motion begins; their mean is the load of
    gravity. A stiction near its limit is measured again. A ramp begins with the duty cycle that holds the joint, at
    home or where it has room within its limits. All other joints are held by their controllers, but an arm and its hand
    are tested at the same time.
    """

    aliases = ("motorStiction", "motor-stiction")
    safety = Safety.EFFORT
    tags = ("motion", "motors", "friction")
    not_per_joint = ("speed",)  # accepted and ignored

    output_step = Parameter(
        list[float], "step of the duty cycle", unit="%", default=[0.5], low=0.01, high=10.0, key="outputStep"
    )
    output_delay = Parameter(
        list[float], "time between two steps", unit="s", default=[0.1], low=0.02, key="outputDelay"
    )
    output_max = Parameter(
        list[float], "greatest duty cycle that is added", unit="%", default=[50.0], low=0.1, high=100.0, key="outputMax"
    )
    threshold = Parameter(list[float], "motion that counts, of the joint", unit="deg", default=[5.0], low=0.5)
    repeat = Parameter(
        int, "most measurements of a motor; one is enough far from the greatest stiction", default=2, low=1
    )
    # Motors with gears of 100:1 take a few per cent; a dry or a bent one several times that.
    stiction = Parameter(
        list[float], "greatest stiction", unit="%", default=[10.0], low=0.1, high=100.0, key="maxStiction"
    )
    speed = Parameter(list[float], "accepted and ignored", unit="deg/s", default=[20.0])

    def setup(self) -> None:
        """Read the steps of the duty cycles."""
        super().setup()
        columns = (
            self.per_joint("outputStep", self.output_step, self.chosen),
            self.per_joint("outputDelay", self.output_delay, self.chosen),
            self.per_joint("outputMax", self.output_max, self.chosen),
            self.per_joint("threshold", self.threshold, self.chosen),
        )
        self.steps = [Steps(_START, *values) for values in zip(*columns, strict=True)]
        self.most = self.per_joint("maxStiction", self.stiction, self.chosen)

    def enough(self, joint: int, found: list[BothWays]) -> bool:
        """End after one measurement far from the limit: its error of a few steps cannot change the verdict."""
        if not found or len(found) >= self.repeat:
            return bool(found)
        most = self._most(joint)
        return abs(float(_stictions(found).mean()) - most) > _FAR * most

    def judge(self, joint: int, found: list[BothWays]) -> None:
        name, place = self.robot_part.names[joint], self.chosen.index(joint)
        for ways in found:
            self.end_if_let_down(joint, ways)
            self._require_motion(name, ways, self.steps[place])
        upwards, downwards = np.array([(ways.positive.breakaway, ways.negative.breakaway) for ways in found]).T
        self.measure("set going upwards", float(upwards.mean()), "%")
        self.measure("set going downwards", float(downwards.mean()), "%")
        self.measure("in the middle, against gravity", float((upwards + downwards).mean() / 2), "%")
        each = _stictions(found)
        mean = float(each.mean())
        # For two or three values the range says more than a confidence interval, which is tens of times wider.
        times = f" ({each.min():.1f} to {each.max():.1f} in {each.size} times)" if each.size > 1 else ""
        hint = (
            f"{name} needs {mean:.1f} %{times} of duty cycle beyond the load of gravity before it moves; "
            f"{likely_causes('weak')}"
        )
        self.measure("stiction", mean, "%", high=self._most(joint), hint=hint)

    def _most(self, joint: int) -> float:
        """Return the greatest stiction (%): more for a motor with a smaller share in its joint."""
        share = abs(float(self.transmission.coupling[joint, joint])) or 1.0
        return self.most[self.chosen.index(joint)] / share

    def _require_motion(self, name: str, ways: BothWays, steps: Steps) -> None:
        for word, ramp in (("positive", ways.positive), ("negative", ways.negative)):
            self.assert_true(
                ramp.moved,
                f"{name} does not move {self.shown(steps.threshold, 'g')} with a {word} duty cycle: "
                f"{ramp.end.value}, at {ramp.added:g} %; {likely_causes('does not move')}",
            )


def _stictions(found: list[BothWays]) -> FloatArray:
    """Return the stiction of each measurement: half the difference of the duty cycles at which motion began."""
    return np.array([(ways.positive.breakaway - ways.negative.breakaway) / 2 for ways in found])
