"""Base class of tests that drive single motors by duty cycle in both directions, away from the joint limits."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.errors import RtfError
from rtf.robot.control_modes import ControlMode
from rtf.robot_testing.guard.limits import GuardError, Limits
from rtf.robot_testing.guard.safety import Safety
from rtf.robot_testing.joints_test import HOMING, JointsTest
from rtf.robot_testing.judging.failure_causes import likely_causes
from rtf.robot_testing.motion.duty_ramp import BASELINE, LEAST_CREEP, LIMIT_MARGIN, Ramp, away_from_limits, limp
from rtf.robot_testing.motion.joints_out_of_limits import exclude_joints_out_of_limits
from rtf.robot_testing.motion.part import PACE
from rtf.robot_testing.motion.routines import run_queues

if TYPE_CHECKING:
    from rtf.robot_testing.guard.transmission import Transmission
    from rtf.robot_testing.motion.duty_ramp import LimpMotor
    from rtf.robot_testing.motion.routines import Routine

#: Distance to the limits that a joint keeps beyond its expected motion, deg.
ROOM = 10.0
#: Tolerance of the position in which a joint is tested, deg; its controller need not be precise.
NEAR = 2.0


class Steps(NamedTuple):
    """The duty cycle steps of one motor: from ``start`` % by ``step`` % every ``delay`` s up to ``most`` %.

    The ramp ends when the joint has moved by ``threshold`` deg.
    """

    start: float
    step: float
    delay: float
    most: float
    threshold: float


class BothWays(NamedTuple):
    """The ramps of one motor. ``held``: whether the controller could hold the joint at the test position.

    ``let_down``: whether no duty cycle could, before one of the ramps, so that the joint began it elsewhere.
    """

    positive: Ramp
    negative: Ramp
    held: bool
    let_down: bool = False

    @property
    def stuck(self) -> float:
        """The sign of the duty cycle that does not move it while the other sign does; 0 in all other cases."""
        return float(self.negative.moved) - float(self.positive.moved)


class DutyTest(JointsTest):
    """A test of motors by duty cycle. Only the joints under test, one in each queue, are without their controllers.

    A subclass sets the ``steps`` of each chosen joint, and judges the ramps in ``judge``.
    """

    safety = Safety.EFFORT
    limits = Limits(speed=2.0)  # a limp joint that begins to turn is faster than one that is controlled

    transmission: Transmission
    steps: list[Steps]

    def setup(self) -> None:
        """Hold the part, and read its transmission."""
        super().setup()
        part = self.robot_part
        self.transmission = self.read_transmission()
        self.transmission.warn_if_unknown(self, part.name)
        with self.guarded():
            self.hold()
        exclude_joints_out_of_limits(part)
        self._done = 0
        self._loose = set[int]()  # joints that their controllers cannot move to a target

    def enough(self, joint: int, found: list[BothWays]) -> bool:  # noqa: ARG002 - for subclasses
        """Whether a motor has been driven in both directions often enough to be judged; by default once."""
        return bool(found)

    def judge(self, joint: int, found: list[BothWays]) -> None:
        """Judge the ramps of a joint. Called in its sub-result."""
        raise NotImplementedError

    def end_if_let_down(self, joint: int, ways: BothWays) -> None:
        """End a joint as inconclusive that was let down, and stays with one sign of the duty cycle: it is at a stop."""
        if ways.let_down and ways.stuck:
            name, word = self.robot_part.names[joint], "positive" if ways.stuck > 0 else "negative"
            self.inconclusive(
                f"{name} does not move with a {word} duty cycle; but no duty cycle held it, and it was let down: it "
                "may rest at a stop; test it in a posture in which gravity does not move it"
            )

    def run(self) -> None:
        """Test motor by motor."""
        self._steps_of = dict(zip(self.chosen, self.steps, strict=True))
        run_queues(
            self.robot_part,
            self.robot_part.one_at_a_time(self.chosen),
            self._routine,
            pace=PACE,
        )

    def _routine(self, joint: int) -> Routine[None]:
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
            if problem is None:
                self.end_if_explained(joint)
                self.judge(joint, found)
        if isinstance(problem, GuardError) and problem.joint >= 0:
            self.judge_own_stop(joint, problem)
        elif problem is not None:
            with self.subresult(part.names[joint]):
                raise problem

    def _is_lost(self, joint: int) -> bool:
        """Return whether a joint cannot be tested, as it or a coupled one was excluded; judge it in that case.

        The guard does not watch an excluded joint, and it must not get power again.
        """
        part, guard = self.robot_part, self.robot_part.guard
        lost = [one for one in self.transmission.coupled(joint) if guard is not None and guard.is_excluded(one)]
        found = joint in lost or (bool(lost) and part.board.control_mode(joint) is ControlMode.IDLE)
        if found and self._evidence.get(part.name):
            return self.judge_if_lost(part, joint)
        if found:
            with self.subresult(part.names[joint]):
                self._judge_lost(joint, lost)
        return found

    def _judge_lost(self, joint: int, lost: list[int]) -> None:
        part, name = self.robot_part, self.robot_part.names[joint]
        if joint not in lost:
            self.inconclusive(
                f"{name} shares motors with {self.names_of(lost)}: its board left it idle together with that one"
            )
        self.assert_fail(
            f"{name} is not driven: it was excluded and left idle. Its encoder shows "
            f"{part.shown(joint, part.board.encoder(joint), '.1f')}, its limits are "
            f"{part.shown(joint, part.low[joint], 'g')} and {part.shown(joint, part.high[joint], 'g')}; "
            f"{likely_causes('beyond limit', 'sign')}"
        )

    def _drive_often(self, joint: int, found: list[BothWays]) -> Routine[None]:
        """Drive a motor until ``enough``. A joint that is blocked in one direction is also tried at another position.

        The robot may block itself, which is no fault of the motor.
        """
        name, steps = self.robot_part.names[joint], self._steps_of[joint]
        place = away_from_limits(self.robot_part, joint, steps.threshold + ROOM)
        held = yield from self._bring(joint, place)
        if not held:
            self._loose.add(joint)
            self.report(f"{name} does not reach {self.shown(place, '.1f')}; it is tested from its rest position")
        while not self.enough(joint, found):
            ways = yield from self._drive_both_ways(joint, place, held=held)
            other = self._elsewhere(joint, place, ways)
            if other != place and (yield from self._bring(joint, other)):
                word = "positive" if ways.stuck > 0 else "negative"
                self.report(
                    f"{name} does not move with a {word} duty cycle at {self.shown(place, '.1f')}: tried at "
                    f"{self.shown(other, '.1f')}"
                )
                place, ways = other, (yield from self._drive_both_ways(joint, other, held=held))
            found.append(ways)
            if not held or ways.stuck:
                return

    def _elsewhere(self, joint: int, place: float, ways: BothWays) -> float:
        """Return a position farther from what may block a joint; the same one if nothing does, or there is no room."""
        if not ways.held or not ways.stuck:
            return place
        part, room = self.robot_part, self._steps_of[joint].threshold + ROOM
        away = -ways.stuck * float(np.sign(self.transmission.factors[joint]))
        low, high = part.low[joint] + ROOM, part.high[joint] - ROOM
        other = float(np.clip(place + away * room, low, max(low, high)))
        return other if (other - place) * away > NEAR else place

    def _drive_both_ways(self, joint: int, place: float, *, held: bool) -> Routine[BothWays]:
        """Drive a motor with both signs, each time from ``place`` if its controller can reach that."""
        part = self.robot_part
        ramps: list[Ramp] = []
        let_down = False
        for sign in (1.0, -1.0):
            yield from self._bring(joint, place)
            with limp(part, self.transmission, joint, held=held) as motor:
                ramps.append((yield from self._drive(motor, sign, held=held)))
            let_down |= motor.let_down
            if held and motor.along:
                yield from part.moving(motor.stood, motor.along, speed=HOMING, tolerance=NEAR)
        positive, negative = ramps
        return BothWays(positive, negative, held, let_down)

    def _bring(self, joint: int, place: float) -> Routine[bool]:
        part = self.robot_part
        if joint in self._loose or (part.guard is not None and part.guard.is_excluded(joint)):
            return False
        return (yield from part.moving([place], [joint], speed=HOMING, tolerance=NEAR)).reached

    def _leave(self, joint: int) -> Routine[None]:
        """Move a joint home, or exclude it if it does not get there."""
        part = self.robot_part
        if not (yield from self._bring(joint, part.home[joint])) and part.guard is not None:
            part.guard.exclude(joint, "its controller does not hold it")

    def _drive(self, motor: LimpMotor, sign: float, *, held: bool) -> Routine[Ramp]:
        if not (yield from motor.rest(held=held)):
            turned, moved = motor.restless
            ways = self.robot_part.shown(motor.joint, turned), self.robot_part.shown(motor.joint, moved)
            text = _restless(self.robot_part.names[motor.joint], turned, moved, ways)
            self.end_if_disturbed(motor.joint, text)
            self.inconclusive(text)
        steps = self._steps_of[motor.joint]
        return (yield from motor.ramp(sign, **steps._asdict(), margin=LIMIT_MARGIN))

    def _keep(self, ways: BothWays) -> None:
        for name, ramp in (("positive", ways.positive), ("negative", ways.negative)):
            if len(ramp.rows):
                time, duty, turned, shown = ramp.rows.T
                columns = {"duty": (duty, "%"), "motor": (turned, "deg"), "joint": (shown, "deg")}
                self.record(f"{name} duty cycle", time=(time, "s"), **columns)


def _restless(name: str, motor: float, joint: float, shown: tuple[str, str]) -> str:
    """Return why a motor cannot be judged whose encoders moved by these angles (deg), as they are shown, at rest."""
    seen = (
        f"{name} does not come to rest without its controller: within {BASELINE:g} s its motor moves by "
        f"{shown[0]} and its joint by {shown[1]}, by their encoders"
    )
    if min(motor, joint) < LEAST_CREEP:
        word = "joint" if motor < joint else "motor"
        return f"{seen}: the {word}'s encoder is noisy, or the other one frozen; {likely_causes('noise', 'frozen')}"
    return f"{seen}; test it in a posture in which gravity does not move it"
