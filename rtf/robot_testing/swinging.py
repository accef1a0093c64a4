"""Joints that swing between two ends while joint and motor encoders are watched: for tests that compare the two."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot_testing.courses import finish, until
from rtf.robot_testing.guard import GuardError
from rtf.robot_testing.part import PACE

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.courses import Course
    from rtf.robot_testing.part import Part
    from rtf.robot_testing.transmission import Transmission

#: Room that is left to a limit, deg.
_ROOM = 2.0
#: A motor that has turned its joint so far, in deg, while the joint's encoder has seen less than this share of it. The
#: play of a gearbox is less. When something else has gone wrong meanwhile, less will do to explain it.
_UNSEEN, _SUSPECT, _SEEN_SHARE = 4.0, 1.0, 0.2
#: How long a swing may take: so many times what the way takes at its speed, and so many seconds more.
_TIMES, _GRACE = 2.0, 5.0


class Ends(NamedTuple):
    """Where a joint swings (deg)."""

    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Outcome:
    """How swings went: nothing to complain of, or what is wrong in a sentence without its subject, and findings.

    With an ``excuse`` it is no fault of the joint, see GuardError.
    """

    complaint: str = ""
    findings: tuple[str, ...] = ()
    excuse: str = ""


def ends_of(part: Part, joint: int, width: float, low: float | None = None, high: float | None = None) -> Ends:
    """The ends of a joint: those that are given, and else ``width`` deg about its home, away from its limits."""
    least, most = float(part.low[joint]), float(part.high[joint])
    room = min(_ROOM, (most - least) / 4)
    half = min(width, most - least - 2 * room) / 2
    centre = float(np.clip(part.home[joint], least + room + half, most - room - half))
    return Ends(centre - half if low is None else low, centre + half if high is None else high)


class Swinger:
    """Moves joints of one part to and fro. A joint that fails is left without power, and the others go on.

    So are those that are coupled with it: boards have such joints idle together, and what their motors do is no longer
    to be told apart.
    """

    def __init__(self, part: Part, transmission: Transmission, *, tolerance: float) -> None:
        self.part = part
        self.transmission = transmission
        self.tolerance = tolerance
        self._doubts: dict[int, str] = {}

    def lost(self, joint: int) -> bool:
        """Whether a joint was given up."""
        return self.part.guard is not None and self.part.guard.given_up(joint)

    def in_doubt(self, joint: int) -> str:
        """Why nothing can be said of a joint that is coupled with one that was given up; "" of any other."""
        return self._doubts.get(joint, "")

    def give_up(self, joints: Collection[int]) -> None:
        """Leave joints without power, and those that are coupled with them."""
        guard = self.part.guard
        if guard is None:
            return
        for joint in joints:
            guard.give_up(joint, "it does not do what it is told")
        for joint in joints:
            self._doubts |= guard.give_up_companions(joint, "which was left without power")

    def swinging(self, joint: int, ends: Ends, count: int, speed: float) -> Course[Outcome]:
        """So many half-swings of one joint, and home again. One that the guard stops is given up as well."""
        targets = [ends.high if number % 2 == 0 else ends.low for number in range(count)]
        try:
            for target in (*targets, float(self.part.home[joint])):
                outcomes = yield from self.moving([target], [joint], [speed])
                if outcomes:
                    return outcomes[joint]
        except GuardError as error:
            self.give_up([joint])
            return Outcome(f"had to be stopped: {error}", ("runs away",), error.excuse)
        return Outcome()

    def go(
        self, targets: Sequence[float] | FloatArray, joints: Sequence[int], speeds: Sequence[float]
    ) -> dict[int, Outcome]:
        """Move joints together and wait; what is wrong with those that did not arrive, which are given up."""
        return finish(self.part, self.moving(targets, joints, speeds), pace=PACE)

    def moving(
        self, targets: Sequence[float] | FloatArray, joints: Sequence[int], speeds: Sequence[float]
    ) -> Course[dict[int, Outcome]]:
        """The same as a course."""
        part = self.part
        failed = {j: self._lost_before(j) for j in joints if self.lost(j)}
        going = [j for j in joints if j not in failed]
        if not going:
            return failed
        wanted, pace = (
            np.array([value for value, j in zip(values, joints, strict=True) if j not in failed])
            for values in (targets, speeds)
        )
        watch = _Watch(part, self.transmission, going, wanted, self.tolerance)
        seconds = float(np.nanmax(_TIMES * watch.away / pace, initial=0.0)) + _GRACE
        part.board.set_reference_speeds(pace, going)
        part.board.position_move(wanted, going)
        try:
            yield from until(part.clock, watch.over, seconds)
            unseen = watch.unseen(_UNSEEN)
        except GuardError:
            watch.look()
            unseen = watch.unseen(_SUSPECT)
            if not unseen:
                raise
        late = _unseen_outcomes(unseen) or watch.late()
        self.give_up(late)
        return failed | {j: self._lost_before(j) for j in going if self.lost(j)} | late

    def _lost_before(self, joint: int) -> Outcome:
        """What is said of a joint that was given up, but not for this move of its own."""
        return Outcome(self._doubts.get(joint, "does not obey any more, and is left alone"), ("sign",))


def _unseen_outcomes(unseen: dict[int, float]) -> dict[int, Outcome]:
    return {
        joint: Outcome(
            f"does not move by its encoder's account, while its motor turns it by {turned:.1f} deg", ("frozen",)
        )
        for joint, turned in unseen.items()
    }


class _Watch:
    """Looks whether joints come to where they shall, and whether a motor turns one whose encoder does not show it.

    The controller of such a joint would turn it on and on. What is said is of the last look, which was at one state,
    and of how far it is then from where it was farthest from its goal: until there it went on with its last move, and
    one that is where it began may have gone there and back.
    """

    def __init__(
        self, part: Part, transmission: Transmission, joints: list[int], wanted: FloatArray, tolerance: float
    ) -> None:
        self._board = part.board
        self._transmission = transmission
        self._joints = joints
        self._wanted = wanted
        self._tolerance = tolerance
        # Of these joints, a row each: how far they were from their goals, where, and how far apart from their motors.
        self._farthest = np.full((3, len(joints)), -np.inf)
        self.look()

    def look(self) -> None:
        """See where joints and motors are now."""
        self._here, motors = self._board.encoders_together()
        self._apart = self._transmission.disagreement(self._here, motors)
        now = np.array([self.away, self._here[self._joints], self._apart[self._joints]])
        self._farthest = np.where(now[0] > self._farthest[0], now, self._farthest)

    @property
    def away(self) -> FloatArray:
        """How far the joints are from where they shall come to (deg)."""
        return np.abs(self._here[self._joints] - self._wanted)

    def over(self) -> bool:
        """Look, and say whether there is nothing more to wait for."""
        self.look()
        return bool((self.away <= self._tolerance).all()) or bool(self.unseen(_UNSEEN))

    def unseen(self, least: float) -> dict[int, float]:
        """The joints that were turned by ``least`` deg or more unseen, and how far their motors turned them (deg)."""
        _, here, apart = self._farthest
        seen, turned = np.abs(self._here[self._joints] - here), np.abs(self._apart[self._joints] - apart)
        rows = zip(self._joints, seen.tolist(), turned.tolist(), strict=True)
        return {joint: far for joint, near, far in rows if far > least and near < _SEEN_SHARE * far}

    def late(self) -> dict[int, Outcome]:
        """What is wrong with the joints that are not there."""
        rows = zip(self._joints, self._here[self._joints].tolist(), self._wanted.tolist(), strict=True)
        return {
            joint: Outcome(
                f"does not come to {goal:.1f} deg within the time it has; it is at {where:.1f} deg", ("does not move",)
            )
            for joint, where, goal in rows
            if not abs(where - goal) <= self._tolerance
        }
