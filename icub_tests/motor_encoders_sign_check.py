"""Signs of motors and encoders: a positive duty cycle makes the motor's encoder count up, and a negative one down."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot_testing import Safety, likely_causes
from rtf.robot_testing.duty_test import DutyTest, Steps
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.robot_testing.duty_ramp import Ramp
    from rtf.robot_testing.duty_test import BothWays

#: The share of the motion that ends a ramp which the other encoder, too, has to show: there may be play between them.
_SHARE = 0.25


class MotorEncodersSignCheck(DutyTest):
    """Drives each motor with a growing duty cycle, first positive, then negative; both its encoders have to follow.

    It begins with the duty cycle at which the controller held the joint, and waits until gravity moves it no more.
    The joint's encoder has to go where the gearbox ratio and the coupling say. Where a joint cannot be held, because of
    the very sign that is wrong, it is tested from where it hangs; one that shows to be far outside of its limits fails
    without being driven.
    """

    aliases = (
        "MotorEncodersSignChecks", "motorEncodersSignCheck", "motorEncoderSignCheck", "motorEncoders-signCheck",
    )  # fmt: skip
    safety = Safety.EFFORT
    tags = ("motion", "encoders", "motors", "sign")
    apart = ("speed",)  # taken and not needed

    pwm_start = Parameter(
        list[float], "duty cycle with which it begins", unit="%", default=[0.0], low=0.0, high=100.0, key="pwmStart"
    )
    pwm_step = Parameter(
        list[float], "by how much it grows at a time", unit="%", default=[1.0], low=0.01, high=20.0, key="pwmStep"
    )
    pwm_max = Parameter(
        list[float], "greatest duty cycle that is added", unit="%", default=[50.0], low=0.1, high=100.0, key="pwmMax"
    )
    command_delay = Parameter(
        list[float], "time between two steps", unit="s", default=[0.1], low=0.02, key="commandDelay"
    )
    threshold = Parameter(
        list[float], "motion that is enough, of the joint", unit="deg", default=[5.0], low=0.5, key="PosThreshold",
        aliases=("Posthreshold", "posThreshold"),
    )  # fmt: skip
    speed = Parameter(list[float], "taken and not needed", unit="deg/s", default=[20.0])

    def setup(self) -> None:
        """Read how the duty cycles grow."""
        super().setup()
        self.steps = [
            Steps(*values)
            for values in zip(
                self.per_joint("pwmStart", self.pwm_start, self.chosen),
                self.per_joint("pwmStep", self.pwm_step, self.chosen),
                self.per_joint("commandDelay", self.command_delay, self.chosen),
                self.per_joint("pwmMax", self.pwm_max, self.chosen),
                self.per_joint("PosThreshold", self.threshold, self.chosen),
                strict=True,
            )
        ]

    def judge(self, joint: int, found: list[BothWays]) -> None:
        name, steps, (ways,) = self.robot_part.names[joint], self.steps[self.chosen.index(joint)], found
        moved = [ramp.moved for ramp in ways[:2]]
        self.assert_true(
            any(moved),
            f"{name} does not move with up to {steps.most:g} % of duty cycle more or less than what holds it; "
            f"{likely_causes('does not move')}",
        )
        for word, sign, ramp in (("positive", 1.0, ways.positive), ("negative", -1.0, ways.negative)):
            if ramp.moved:
                self._judge_way(name, word, sign, steps, ramp)
            elif ways.held:  # else it hangs at a limit, perhaps, and there is no way to go
                self.check(
                    condition=False,
                    text=f"{name} does not move with a {word} duty cycle: {ramp.end.value}, at {ramp.added:g} %; "
                    f"{likely_causes('does not move')}",
                )

    def _judge_way(self, name: str, word: str, sign: float, steps: Steps, ramp: Ramp) -> None:
        least = _SHARE * steps.threshold
        motor, joint = sign * ramp.motor, sign * ramp.joint
        hint = f"{name}, {word} duty cycle: {_diagnosis(motor, joint, least)}"
        self.measure(f"motor follows a {word} duty cycle", motor, "deg", low=least, hint=hint)
        # What is said of both is said once.
        self.measure(f"joint follows a {word} duty cycle", joint, "deg", low=least, hint=hint if motor >= least else "")
        self.measure(f"first motion with a {word} duty cycle", ramp.breakaway, "%")


def _diagnosis(motor: float, joint: float, least: float) -> str:
    """What is wrong when motor and joint go so far where both should go at least ``least`` deg, and one does not."""
    if motor <= -least and joint <= -least:
        return (
            f"motor and joint turn the wrong way, and agree: the motor's wires or its mounting; {likely_causes('sign')}"
        )
    if motor <= -least:
        return f"the motor's encoder counts the wrong way, the joint's the right one; {likely_causes('sign')}"
    if joint <= -least:
        return (
            "the joint turns the other way than its motor says: the sign of its encoder, or of the gearbox ratio; "
            f"{likely_causes('sign')}"
        )
    if motor < least:
        return f"the joint moves by {joint:.1f} deg, the motor's encoder does not; {likely_causes('frozen')}"
    return f"the motor moves by {motor:.1f} deg, the joint's encoder does not; {likely_causes('frozen', 'backlash')}"
