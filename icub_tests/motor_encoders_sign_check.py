"""Signs of motors and encoders: a positive duty cycle makes the motor encoder count up, a negative one down."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot_testing import Safety, likely_causes
from rtf.robot_testing.duty_test import DutyTest, Steps
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.robot_testing.duty_test import BothWays
    from rtf.robot_testing.motion.duty_ramp import Ramp

#: Share of the threshold that both encoders have to show: there may be play between them.
_SHARE = 0.25


class MotorEncodersSignCheck(DutyTest):
    """Drives each motor with a growing duty cycle, first positive, then negative; both of its encoders have to follow.

    A ramp begins with the duty cycle at which the controller held the joint, once the joint is at rest. The joint
    encoder has to move as gearbox ratio and coupling say. A joint that its controller cannot hold, such as one with a
    wrong sign, is tested from its rest position. A joint far outside of its limits fails without being driven.
    """

    aliases = (
        "MotorEncodersSignChecks", "motorEncodersSignCheck", "motorEncoderSignCheck", "motorEncoders-signCheck",
    )  # fmt: skip
    safety = Safety.EFFORT
    tags = ("motion", "encoders", "motors", "sign")
    not_per_joint = ("speed",)  # accepted and ignored

    pwm_start = Parameter(list[float], "first duty cycle", unit="%", default=[0.0], low=0.0, high=100.0, key="pwmStart")
    pwm_step = Parameter(
        list[float], "step of the duty cycle", unit="%", default=[1.0], low=0.01, high=20.0, key="pwmStep"
    )
    pwm_max = Parameter(
        list[float], "greatest duty cycle that is added", unit="%", default=[50.0], low=0.1, high=100.0, key="pwmMax"
    )
    command_delay = Parameter(
        list[float], "time between two steps", unit="s", default=[0.1], low=0.02, key="commandDelay"
    )
    threshold = Parameter(
        list[float], "motion of the joint that ends a ramp", unit="deg", default=[5.0], low=0.5, key="PosThreshold",
        aliases=("Posthreshold", "posThreshold"),
    )  # fmt: skip
    speed = Parameter(list[float], "accepted and ignored", unit="deg/s", default=[20.0])

    def setup(self) -> None:
        """Read the steps of the duty cycles."""
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
            f"{name} does not move within {steps.most:g} % about the duty cycle that holds it; "
            f"{likely_causes('does not move')}",
        )
        for word, sign, ramp in (("positive", 1.0, ways.positive), ("negative", -1.0, ways.negative)):
            if ramp.moved:
                self._judge_way(name, word, sign, steps, ramp)
            elif ways.held and not ways.let_down:  # otherwise it may rest at a limit
                self.check(
                    condition=False,
                    text=f"{name} does not move with a {word} duty cycle: {ramp.end.value}, at {ramp.added:g} %; "
                    f"{likely_causes('does not move')}",
                )

        self.end_if_let_down(joint, ways)

    def _judge_way(self, name: str, word: str, sign: float, steps: Steps, ramp: Ramp) -> None:
        least = _SHARE * steps.threshold
        motor, joint = sign * ramp.motor, sign * ramp.joint
        hint = f"{name}, {word} duty cycle: {_diagnosis(motor, joint, least, self.shown)}"
        self.measure(f"motor follows a {word} duty cycle", motor, "deg", low=least, hint=hint)
        # A diagnosis of both is given once.
        self.measure(f"joint follows a {word} duty cycle", joint, "deg", low=least, hint=hint if motor >= least else "")
        self.measure(f"first motion with a {word} duty cycle", ramp.breakaway, "%")


def _diagnosis(motor: float, joint: float, least: float, shown: Callable[[float, str], str]) -> str:
    """Return the diagnosis of the motions of motor and joint (deg), of which one is less than ``least``."""
    if motor <= -least and joint <= -least:
        return f"motor and joint both turn the wrong way: the motor's wires or its mounting; {likely_causes('sign')}"
    if motor <= -least:
        return f"the motor's encoder counts the wrong way, the joint's the right one; {likely_causes('sign')}"
    if joint <= -least:
        return (
            "the joint turns against its motor: the sign of its encoder, or of the gearbox ratio; "
            f"{likely_causes('sign')}"
        )
    if motor < least:
        return f"the joint moves by {shown(joint, '.1f')}, the motor's encoder does not; {likely_causes('frozen')}"
    causes = likely_causes("frozen", "backlash")
    return f"the motor moves by {shown(motor, '.1f')}, the joint's encoder does not; {causes}"
