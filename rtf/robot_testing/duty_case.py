"""The test case of motors that are driven by their duty cycles, one after the other, both ways."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rtf.robot.errors import RobotError
from rtf.robot_testing.duty_ramp import LIMIT_MARGIN, Ramp, away_from_limits, limp
from rtf.robot_testing.guard import Limits
from rtf.robot_testing.joints_case import HOMING, JointsTest
from rtf.robot_testing.safety import Safety
from rtf.robot_testing.strays import give_up_strays
from rtf.robot_testing.transmission import Transmission

if TYPE_CHECKING:
    from rtf.robot_testing.duty_ramp import LimpMotor

#: How far from its limits a joint is tested, beyond what it is going to move, deg.
ROOM = 10.0
#: How near a joint has to come to where it is tested, deg; what holds it there need not be precise.
NEAR = 2.0


class Steps(NamedTuple):
    """How the duty cycle of one motor grows: from ``start`` % by ``step`` % every ``delay`` s to ``most`` %.

    It ends when the joint has moved by ``threshold`` deg.
    """

    start: float
    step: float
    delay: float
    most: float
    threshold: float


class BothWays(NamedTuple):
    """The ramps of one motor. ``held``: whether its controller could bring it to where it was tested, and hold it."""

    positive: Ramp
    negative: Ramp
    held: bool


class DutyTest(JointsTest):
    """A test of motors by their duty cycles. Only the joint of the one that is tested is without its controller."""

    safety = Safety.EFFORT
    limits = Limits(speed=3.0)  # a limp joint that begins to turn is faster than one that is controlled

    transmission: Transmission

    def setup(self) -> None:
        """Hold the part, and see how it is geared."""
        super().setup()
        part = self.robot_part
        try:
            self.transmission = Transmission.read(part.board)
        except RobotError as error:
            self.assert_error(f"{part.name}: {error}")
        self.hold()
        give_up_strays(part)

    def drive_both_ways(self, joint: int, steps: Steps) -> BothWays:
        """Bring a joint to its place, drive its motor with both signs from there, and bring it home."""
        part = self.robot_part
        place = away_from_limits(part, joint, steps.threshold + ROOM)
        held = self._bring(joint, place)
        if not held:
            self.report(f"{part.names[joint]} does not come to {place:.1f} deg; it is tested from where it hangs")
        try:
            with limp(part, self.transmission, joint, held=held) as motor:
                positive = self._drive(motor, 1.0, steps, held=held)
            self._bring(joint, place, held=held)
            with limp(part, self.transmission, joint, held=held) as motor:
                negative = self._drive(motor, -1.0, steps, held=held)
        finally:
            self._leave(joint, held=held)
        for name, ramp in (("positive", positive), ("negative", negative)):
            if len(ramp.rows):
                time, duty, turned, shown = ramp.rows.T
                columns = {"duty": (duty, "%"), "motor": (turned, "deg"), "joint": (shown, "deg")}
                self.record(f"{name} duty cycle", time=(time, "s"), **columns)
        return BothWays(positive, negative, held)

    def _bring(self, joint: int, place: float, *, held: bool = True) -> bool:
        if not held or (self.robot_part.guard is not None and self.robot_part.guard.given_up(joint)):
            return False
        return self.robot_part.move([place], [joint], speed=HOMING, tolerance=NEAR).reached

    def _leave(self, joint: int, *, held: bool) -> None:
        part = self.robot_part
        if not self._bring(joint, part.home[joint], held=held) and part.guard is not None:
            part.guard.give_up(joint, "its controller does not hold it")

    def _drive(self, motor: LimpMotor, sign: float, steps: Steps, *, held: bool) -> Ramp:
        if not motor.rest(held=held):
            self.inconclusive(
                f"{self.robot_part.names[motor.joint]} does not come to rest without its controller; test it where "
                "gravity does not move it"
            )
        return motor.ramp(sign, **steps._asdict(), margin=LIMIT_MARGIN)
