"""The test case of motors that are driven by their duty cycles, both ways, from where their joints have room."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.errors import RtfError
from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import RobotError
from rtf.robot_testing.causes import likely_causes
from rtf.robot_testing.courses import singly, work
from rtf.robot_testing.duty_ramp import BASELINE, LEAST_CREEP, LIMIT_MARGIN, Ramp, away_from_limits, limp
from rtf.robot_testing.guard import GuardError, Limits
from rtf.robot_testing.joints_case import HOMING, JointsTest
from rtf.robot_testing.out_of_limits import give_up_strays
from rtf.robot_testing.part import PACE
from rtf.robot_testing.safety import Safety
from rtf.robot_testing.transmission import Transmission

if TYPE_CHECKING:
    from rtf.robot_testing.courses import Course
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

    @property
    def stuck(self) -> float:
        """The sign of the duty cycle with which it does not move, though it does with the other; 0 in other cases."""
        return float(self.negative.moved) - float(self.positive.moved)


class DutyTest(JointsTest):
    """A test of motors by their duty cycles. Only joints under test are without their controllers, one in each queue.

    Who derives from it says the ``steps`` of each chosen joint, and judges what came of them.
    """

    safety = Safety.EFFORT
    limits = Limits(speed=2.0)  # a limp joint that begins to turn is faster than one that is controlled

    transmission: Transmission
    steps: list[Steps]

    def setup(self) -> None:
        """Hold the part, and see how it is geared."""
        super().setup()
        part = self.robot_part
        try:
            self.transmission = Transmission.read(part.board)
        except RobotError as error:
            self.assert_error(f"{part.name}: {error}")
        self.transmission.tell(self, part.name)
        self.hold()
        give_up_strays(part)
        self._done = 0
        self._loose = set[int]()  # joints that their controllers do not bring where they are told

    def enough(self, joint: int, found: list[BothWays]) -> bool:  # noqa: ARG002 - for who derives
        """Whether a motor has been driven both ways often enough to be judged; once, as a rule."""
        return bool(found)

    def judge(self, joint: int, found: list[BothWays]) -> None:
        """Judge the ramps of a joint that was driven; in its sub-result."""
        raise NotImplementedError

    def run(self) -> None:
        """Test motor by motor."""
        self._steps_of = dict(zip(self.chosen, self.steps, strict=True))
        work(self.robot_part, singly(self.robot_part.names, self.chosen), self._course, pace=PACE)

    def _course(self, joint: int) -> Course[None]:
        part, problem = self.robot_part, None
        found: list[BothWays] = []
        if self._is_lost(joint):
            self._done += 1
            return
        try:
            yield from self._drive_often(joint, found)
        except RtfError as error:
            problem = error
        try:
            yield from self._leave(joint)
        except GuardError as error:
            problem = problem or error
        self._done += 1
        self.progress(self._done / len(self.chosen), part.names[joint])
        with self.subresult(part.names[joint]):
            for ways in found:
                self._keep(ways)
            if problem is not None:
                raise problem
            self.judge(joint, found)

    def _is_lost(self, joint: int) -> bool:
        """Judge a joint whose motor is not to be driven: nobody watches one that was given up, or is to power it."""
        part, guard = self.robot_part, self.robot_part.guard
        lost = [one for one in self.transmission.coupled(joint) if guard is not None and guard.given_up(one)]
        found = joint in lost or (bool(lost) and part.board.control_mode(joint) is ControlMode.IDLE)
        if found:
            with self.subresult(part.names[joint]):
                self._judge_lost(joint, lost)
        return found

    def _judge_lost(self, joint: int, lost: list[int]) -> None:
        part, name = self.robot_part, self.robot_part.names[joint]
        if joint not in lost:
            self.inconclusive(
                f"{name} shares motors with {self.names_of(lost)}: when that was left idle, its board left it idle, too"
            )
        self.assert_fail(
            f"{name} is not driven, for it had to be left idle: it shows {part.board.encoder(joint):.1f} deg, its "
            f"limits are {part.low[joint]:g} and {part.high[joint]:g} deg; {likely_causes('beyond limit', 'sign')}"
        )

    def _drive_often(self, joint: int, found: list[BothWays]) -> Course[None]:
        """Drive a motor as often as it is to be. A joint that is blocked on one side is tried at another place, too.

        A robot may be in its own way, which says nothing of the motor.
        """
        name, steps = self.robot_part.names[joint], self._steps_of[joint]
        place = away_from_limits(self.robot_part, joint, steps.threshold + ROOM)
        held = yield from self._bring(joint, place)
        if not held:
            self._loose.add(joint)
            self.report(f"{name} does not come to {place:.1f} deg; it is tested from where it hangs")
        while not self.enough(joint, found):
            ways = yield from self._drive_both_ways(joint, place, held=held)
            other = self._elsewhere(joint, place, ways)
            if other != place and (yield from self._bring(joint, other)):
                word = "positive" if ways.stuck > 0 else "negative"
                self.report(
                    f"{name} does not move with a {word} duty cycle at {place:.1f} deg: tried at {other:.1f} deg"
                )
                place, ways = other, (yield from self._drive_both_ways(joint, other, held=held))
            found.append(ways)
            if not held or ways.stuck:
                return

    def _elsewhere(self, joint: int, place: float, ways: BothWays) -> float:
        """A place further from what may block a joint; the same when nothing does, or there is no room."""
        if not ways.held or not ways.stuck:
            return place
        part, room = self.robot_part, self._steps_of[joint].threshold + ROOM
        away = -ways.stuck * float(np.sign(self.transmission.factors[joint]))
        low, high = part.low[joint] + ROOM, part.high[joint] - ROOM
        other = float(np.clip(place + away * room, low, max(low, high)))
        return other if (other - place) * away > NEAR else place

    def _drive_both_ways(self, joint: int, place: float, *, held: bool) -> Course[BothWays]:
        """Drive a motor with both signs, each time from the place of its joint, where that one is."""
        part = self.robot_part
        ramps: list[Ramp] = []
        for sign in (1.0, -1.0):
            yield from self._bring(joint, place)
            with limp(part, self.transmission, joint, held=held) as motor:
                ramps.append((yield from self._drive(motor, sign, held=held)))
            if held and motor.along:
                yield from part.moving(motor.stood, motor.along, speed=HOMING, tolerance=NEAR)
        positive, negative = ramps
        return BothWays(positive, negative, held)

    def _bring(self, joint: int, place: float) -> Course[bool]:
        part = self.robot_part
        if joint in self._loose or (part.guard is not None and part.guard.given_up(joint)):
            return False
        return (yield from part.moving([place], [joint], speed=HOMING, tolerance=NEAR)).reached

    def _leave(self, joint: int) -> Course[None]:
        """Bring a joint home, or give it up."""
        part = self.robot_part
        if not (yield from self._bring(joint, part.home[joint])) and part.guard is not None:
            part.guard.give_up(joint, "its controller does not hold it")

    def _drive(self, motor: LimpMotor, sign: float, *, held: bool) -> Course[Ramp]:
        if not (yield from motor.rest(held=held)):
            self.inconclusive(_restless(self.robot_part.names[motor.joint], *motor.restless))
        steps = self._steps_of[motor.joint]
        return (yield from motor.ramp(sign, **steps._asdict(), margin=LIMIT_MARGIN))

    def _keep(self, ways: BothWays) -> None:
        for name, ramp in (("positive", ways.positive), ("negative", ways.negative)):
            if len(ramp.rows):
                time, duty, turned, shown = ramp.rows.T
                columns = {"duty": (duty, "%"), "motor": (turned, "deg"), "joint": (shown, "deg")}
                self.record(f"{name} duty cycle", time=(time, "s"), **columns)


def _restless(name: str, motor: float, joint: float) -> str:
    """Why nothing can be said of a motor whose encoders went so far (deg) where they should rest."""
    seen = (
        f"{name} does not come to rest without its controller: within {BASELINE:g} s its motor goes {motor:.2f} deg "
        f"and the joint {joint:.2f} deg, by their encoders"
    )
    if min(motor, joint) < LEAST_CREEP:
        word = "joint" if motor < joint else "motor"
        return f"{seen}: that of the {word} is noisy, or the other one frozen; {likely_causes('noise', 'frozen')}"
    return f"{seen}; test it where gravity does not move it"
