"""Joints that swing between two ends while joint and motor encoders are watched: for tests that compare the two."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot_testing.courses import finish, until
from rtf.robot_testing.guard import GuardError
from rtf.robot_testing.part import PACE

if TYPE_CHECKING:
    from collections.abc import Sequence

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
    """How swings went: nothing to complain of, or what is wrong in a sentence without its subject, and findings."""

    complaint: str = ""
    findings: tuple[str, ...] = ()


def ends_of(part: Part, joint: int, width: float, low: float | None = None, high: float | None = None) -> Ends:
    """The ends of a joint: those that are given, and else ``width`` deg about its home, away from its limits."""
    least, most = float(part.low[joint]), float(part.high[joint])
    room = min(_ROOM, (most - least) / 4)
    half = min(width, most - least - 2 * room) / 2
    centre = float(np.clip(part.home[joint], least + room + half, most - room - half))
    return Ends(centre - half if low is None else low, centre + half if high is None else high)


class Swinger:
    """Moves joints of one part to and fro. A joint that fails is left without power, and the others go on."""

    def __init__(self, part: Part, transmission: Transmission, *, tolerance: float) -> None:
        self.part = part
        self.transmission = transmission
        self.tolerance = tolerance

    def lost(self, joint: int) -> bool:
        """Whether a joint was given up."""
        return self.part.guard is not None and self.part.guard.given_up(joint)

    def swinging(self, joint: int, ends: Ends, count: int, speed: float) -> Course[Outcome]:
        """So many half-swings of one joint, and home again. One that the guard stops is given up as well."""
        targets = [ends.high if number % 2 == 0 else ends.low for number in range(count)]
        try:
            for target in (*targets, float(self.part.home[joint])):
                outcomes = yield from self.moving([target], [joint], [speed])
                if outcomes:
                    return outcomes[joint]
        except GuardError as error:
            self._give_up(joint)
            return Outcome(f"had to be stopped: {error}", ("runs away",))
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
        failed = {j: Outcome("does not obey any more, and is left alone", ("sign",)) for j in joints if self.lost(j)}
        going = [j for j in joints if j not in failed]
        if not going:
            return failed
        wanted, pace = (
            np.array([value for value, j in zip(values, joints, strict=True) if j not in failed])
            for values in (targets, speeds)
        )
        begin, watch = part.board.encoders(going), _Watch(part, self.transmission, going)
        part.board.set_reference_speeds(pace, going)
        part.board.position_move(wanted, going)
        seconds = float(np.max(_TIMES * np.abs(wanted - begin) / pace)) + _GRACE
        try:
            yield from until(part.clock, lambda: self._arrived(going, wanted) or bool(watch.unseen(_UNSEEN)), seconds)
            unseen = watch.unseen(_UNSEEN)
        except GuardError:
            unseen = watch.unseen(_SUSPECT)
            if not unseen:
                raise
        for joint, outcome in self._late(going, wanted, unseen).items():
            failed[joint] = outcome
            self._give_up(joint)
        return failed

    def _give_up(self, joint: int) -> None:
        if self.part.guard is not None:
            self.part.guard.give_up(joint, "it does not do what it is told")

    def _arrived(self, going: list[int], wanted: FloatArray) -> bool:
        return bool((np.abs(self.part.board.encoders(going) - wanted) <= self.tolerance).all())

    def _late(self, going: list[int], wanted: FloatArray, unseen: dict[int, float]) -> dict[int, Outcome]:
        if unseen:
            return {
                joint: Outcome(
                    f"does not move by its encoder's account, while its motor turns it by {turned:.1f} deg", ("frozen",)
                )
                for joint, turned in unseen.items()
            }
        here = self.part.board.encoders(going).tolist()
        return {
            joint: Outcome(
                f"does not come to {goal:.1f} deg within the time it has; it is at {where:.1f} deg", ("does not move",)
            )
            for joint, where, goal in zip(going, here, wanted.tolist(), strict=True)
            if abs(where - goal) > self.tolerance
        }


class _Watch:
    """Looks whether a motor turns a joint whose encoder does not show it: its controller would turn it on and on."""

    def __init__(self, part: Part, transmission: Transmission, joints: Sequence[int]) -> None:
        self._part = part
        self._transmission = transmission
        self._joints = joints
        self._joint_0, self._motor_0 = part.board.encoders(), part.board.motor_encoders()

    def unseen(self, least: float) -> dict[int, float]:
        """The joints that were turned by ``least`` deg or more unseen, and how far their motors turned them (deg)."""
        board = self._part.board
        seen = np.abs(board.encoders() - self._joint_0)
        turned = np.abs(board.motor_encoders() - self._motor_0) / np.abs(self._transmission.factors)
        return {j: float(turned[j]) for j in self._joints if turned[j] > least and seen[j] < _SEEN_SHARE * turned[j]}
