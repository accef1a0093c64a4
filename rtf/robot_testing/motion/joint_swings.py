"""Swinging joints between two ends while joint and motor encoders are compared, for tests of encoders."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.judging.blame import Blame, Evidence, Strength, blame
from rtf.robot_testing.motion.disturbance import limpness
from rtf.robot_testing.motion.joints_out_of_limits import exclude_joints_out_of_limits
from rtf.robot_testing.motion.part import PACE
from rtf.robot_testing.motion.routines import run_to_end, until
from rtf.robot_testing.motion.stop_evidence import stop_evidence

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.guard.transmission import Transmission
    from rtf.robot_testing.motion.part import Part
    from rtf.robot_testing.motion.routines import Routine

#: Distance to a limit, deg.
_ROOM = 2.0
#: A joint encoder counts as frozen if the motor has turned the joint by this angle, deg, and the encoder shows less
#: than this share of it. The play of a gearbox is less. After a stop by the guard the second, smaller way is enough.
_UNSEEN, _SUSPECT, _SEEN_SHARE = 4.0, 1.0, 0.2
#: Readings of encoders whose median is compared.
_READINGS = 3
#: Time-out of a swing: a multiple of its expected time, and additional seconds.
_TIMES, _GRACE = 2.0, 5.0


class Ends(NamedTuple):
    """The ends of a joint's swing (deg)."""

    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of swings: ``complaint``, a failure text without its subject ("" if none), and its findings.

    With an ``excuse`` it is no fault of the joint, see GuardError. ``limp`` says which other joints were without power
    already: the part moved in another way than its controllers meant it to.
    """

    complaint: str = ""
    findings: tuple[str, ...] = ()
    excuse: str = ""
    limp: str = ""


def ends_of(part: Part, joint: int, width: float, low: float | None = None, high: float | None = None) -> Ends:
    """Return the ends of a joint's swing: the given ones, or ``width`` deg about its home, shifted into its limits."""
    least, most = float(part.low[joint]), float(part.high[joint])
    room = min(_ROOM, (most - least) / 4)
    half = min(width, most - least - 2 * room) / 2
    centre = float(np.clip(part.home[joint], least + room + half, most - room - half))
    return Ends(centre - half if low is None else low, centre + half if high is None else high)


class JointSwinger:
    """Swings the joints of one part. A joint that is to blame is excluded and left without power; the others go on.

    The joints coupled with it are excluded, too: boards leave such joints idle together, and the motions of their
    motors cannot be told apart any more. ``evidence`` is what the motions have shown of all joints of the part.
    """

    def __init__(self, part: Part, transmission: Transmission, *, tolerance: float) -> None:
        self.part = part
        self.transmission = transmission
        self.tolerance = tolerance
        self.evidence: list[Evidence] = []
        self._doubts: dict[int, str] = {}
        self._limp: dict[int, str] = {}  # of joints that were stopped: which others were without power then

    def lost(self, joint: int) -> bool:
        """Whether a joint was excluded."""
        return self.part.guard is not None and self.part.guard.is_excluded(joint)

    def in_doubt(self, joint: int) -> str:
        """Return why a joint cannot be judged: it is coupled with an excluded one; "" for any other joint."""
        return self._doubts.get(joint, "")

    def verdict(self, joint: int, outcome: Outcome) -> Blame | None:
        """Return the verdict on a joint by the evidence; None if its swings are complete, and nothing accuses it."""
        name = self.part.names[joint]
        own = [one for one in self.evidence if one.strength > Strength.UNCERTAIN and joint in one.joints]
        certain = [one for one in own if one.strength is Strength.CERTAIN]
        if not certain and (doubt := self.in_doubt(joint)):
            return Blame(failed=False, text=f"{name} {doubt}: it cannot be judged")
        if not outcome.complaint:
            return blame(joint, certain[0], certain) if certain else None
        if outcome.limp and not own:
            return Blame(failed=False, text=f"{name} {outcome.complaint}; but {outcome.limp}")
        return blame(joint, _evidence(self.part, joint, outcome), self.evidence)

    def _blamed(self, found: Collection[Evidence], suspects: Collection[int]) -> set[int]:
        """Keep evidence; return the joints that it accuses with certainty, else the suspects.

        Joints that are excluded already do no more harm: then it is the suspects, too. They are limp, and shake the
        others: what is uncertain is no evidence then.
        """
        limp = self.part.guard is not None and bool(self.part.guard.excluded)
        kept = [one for one in found if one.strength > Strength.UNCERTAIN or not limp]
        self.evidence += [one for one in kept if one not in self.evidence]
        wrong = {joint for one in found if one.strength > Strength.UNCERTAIN for joint in one.joints}
        return wrong if any(not self.lost(joint) for joint in wrong) else {*suspects}

    def begin(self, hold: Callable[[], None]) -> None:
        """Hold all joints, and exclude those that are out of limits.

        If the guard stops one they are held again without those to blame.
        """
        while True:
            try:
                hold()
            except GuardError as error:
                self.stopped(error)
            else:
                break
        self._exclude_out_of_limits()

    def _exclude_out_of_limits(self) -> None:
        """Exclude the joints that are far outside of their limits before anything moves, and who is to blame for it."""
        outside = exclude_joints_out_of_limits(self.part)
        if outside:
            found = stop_evidence(self.part, None, self.transmission, late=outside)
            self.exclude({*outside, *self._blamed(found, outside)})

    def exclude(self, joints: Collection[int]) -> None:
        """Exclude joints and those that are coupled with them; leave all of them without power."""
        guard = self.part.guard
        if guard is None:
            return
        for joint in joints:
            guard.exclude(joint, "it does not obey its commands")
        for joint in joints:
            self._doubts |= guard.exclude_coupled(joint, "which was left without power")

    def swinging(self, joint: int, ends: Ends, count: int, speed: float) -> Routine[Outcome]:
        """Move one joint through ``count`` half-swings and home again.

        If the guard stops a motion the joint that is to blame is excluded; another one is held where it is.
        """
        targets = [ends.high if number % 2 == 0 else ends.low for number in range(count)]
        return (yield from self.visiting(joint, [(target, speed) for target in (*targets, self.part.home[joint])]))

    def visiting(self, joint: int, stops: Sequence[tuple[float, float]]) -> Routine[Outcome]:
        """Move one joint to positions (deg), to each with its speed (deg/s). One that the guard stops is excluded."""
        try:
            for target, speed in stops:
                outcomes = yield from self.moving([float(target)], [joint], [speed])
                if outcomes:
                    return outcomes[joint]
        except GuardError as error:
            return self._stopped(joint, error)
        return Outcome()

    def _stopped(self, joint: int, error: GuardError) -> Outcome:
        """Exclude the joint that is to blame for a stop during the swings of a joint, and hold that one."""
        blamed, limp = self._note(error), limpness(self.part, joint)
        self._limp |= {one: limpness(self.part, one) for one in blamed if not self.lost(one)}
        if joint not in blamed and self.part.guard is not None:
            self.part.guard.halt([joint])
        self.exclude(blamed)
        what = "had to be stopped" if joint == error.joint else "was not swung to the end"
        return Outcome(f"{what}: {error}", (error.finding,), error.excuse, limp)

    def stopped(self, error: GuardError) -> dict[int, Outcome]:
        """Exclude the joints that are to blame for a stop, and return their outcomes.

        Raises the error again if nobody is, or all of them are excluded already.
        """
        blamed = self._note(error)
        if all(self.lost(joint) for joint in blamed):
            raise error
        self.exclude(blamed)
        return {joint: Outcome(f"had to be stopped: {error}", (error.finding,), error.excuse) for joint in blamed}

    def _note(self, error: GuardError) -> set[int]:
        found = stop_evidence(self.part, error, self.transmission)
        return self._blamed(found, [error.joint] if error.joint >= 0 else [])

    def go(
        self, targets: Sequence[float] | FloatArray, joints: Sequence[int], speeds: Sequence[float]
    ) -> dict[int, Outcome]:
        """Move joints together and wait. Exclude those that do not arrive, and return their outcomes."""
        return run_to_end(self.part, self.moving(targets, joints, speeds), pace=PACE)

    def moving(
        self, targets: Sequence[float] | FloatArray, joints: Sequence[int], speeds: Sequence[float]
    ) -> Routine[dict[int, Outcome]]:
        """Return the routine of ``go``."""
        part = self.part
        failed = {j: self._lost_before(j) for j in joints if self.lost(j)}
        going = [j for j in joints if j not in failed]
        if not going:
            return failed
        wanted, pace = (
            np.array([value for value, j in zip(values, joints, strict=True) if j not in failed])
            for values in (targets, speeds)
        )
        pace = part.paced(pace, going)
        watch = _Watch(part, self.transmission, going, wanted, self.tolerance)
        seconds = float(np.nanmax(_TIMES * watch.away / pace, initial=0.0)) + _GRACE
        part.board.set_reference_speeds(pace, going)
        part.command_move(wanted, going)
        try:
            yield from until(part.clock, lambda: watch.over() or all(map(self.lost, going)), seconds)
            unseen = watch.unseen(_UNSEEN)
        except GuardError:
            watch.update()
            unseen = watch.unseen(_SUSPECT)
            if not unseen:
                raise
        late = _unseen_outcomes(part, unseen) or watch.late(part)
        # Those that were excluded on the way were left without power by the guard, for another joint.
        late = {joint: outcome for joint, outcome in late.items() if not self.lost(joint)}
        if late:
            found = stop_evidence(part, None, self.transmission, late=late)
            certain = {*unseen} - self._explained(found)
            found += [
                _evidence(part, joint, late[joint], Strength.CERTAIN if joint in certain else Strength.UNCERTAIN)
                for joint in late
            ]
            self.exclude(self._blamed(found, late))
        return failed | {j: self._lost_before(j) for j in going if self.lost(j)} | late

    def _explained(self, found: Collection[Evidence]) -> set[int]:
        """Return the joints that share motors with those whom certain evidence accuses, and are not accused."""
        wrong = {joint for one in found if one.strength is Strength.CERTAIN for joint in one.joints}
        return {other for joint in wrong for other in self.transmission.coupled(joint)} - wrong

    def _lost_before(self, joint: int) -> Outcome:
        """Return the outcome of a joint that was excluded for another reason than this move."""
        text = self._doubts.get(joint, "does not obey any more, and is excluded")
        return Outcome(text, ("sign",), limp=self._limp.get(joint, ""))


def _unseen_outcomes(part: Part, unseen: dict[int, float]) -> dict[int, Outcome]:
    return {
        joint: Outcome(
            f"does not move by its encoder, while its motor moves it by {part.shown(joint, turned, '.1f')}", ("frozen",)
        )
        for joint, turned in unseen.items()
    }


def _evidence(part: Part, joint: int, outcome: Outcome, strength: Strength = Strength.UNCERTAIN) -> Evidence:
    """Return the outcome of a joint as evidence against it."""
    text = f"{part.names[joint]} {outcome.complaint}"
    return Evidence(frozenset({joint}), text, outcome.findings, strength, outcome.excuse)


def _median(readings: Sequence[FloatArray]) -> FloatArray:
    """Return the median of a few readings; not a number where one of them is none."""
    if len(readings) != _READINGS:
        few: FloatArray = np.median(np.array(readings), axis=0)
        return few
    first, second, third = readings  # at every tick: this takes a twentieth of the time of numpy's median
    middle: FloatArray = np.maximum(np.minimum(first, second), np.minimum(np.maximum(first, second), third))
    return middle


class _Watch:
    """Checks whether joints arrive at their targets, and whether a motor turns a joint whose encoder is frozen.

    The controller of a joint with a frozen encoder would turn it on and on. The last state is compared with the state
    in which the joint was farthest from its target: before that one it went on with its previous move, and a joint that
    is where it began may have moved there and back.
    """

    def __init__(
        self, part: Part, transmission: Transmission, joints: list[int], wanted: FloatArray, tolerance: float
    ) -> None:
        self._board = part.board
        self._transmission = transmission
        self._joints = joints
        self._wanted = wanted
        self._tolerance = tolerance
        # Rows, at the greatest distance to the target: distance, position, and disagreement with the motor encoder.
        self._farthest = np.full((3, len(joints)), -np.inf)
        self._read: deque[FloatArray] = deque(maxlen=_READINGS)
        self.update()

    def update(self) -> None:
        """Read the positions of joints and motors; the median of the last readings counts, so that no spike does."""
        self._read.append(np.array(self._board.encoders_together()))
        self._here, motors = _median(self._read)
        self._apart = self._transmission.disagreement(self._here, motors)
        if len(self._read) == _READINGS:
            now = np.array([self.away, self._here[self._joints], self._apart[self._joints]])
            self._farthest = np.where(now[0] > self._farthest[0], now, self._farthest)

    @property
    def away(self) -> FloatArray:
        """The distances of the joints to their targets (deg)."""
        away: FloatArray = np.abs(self._here[self._joints] - self._wanted)
        return away

    def over(self) -> bool:
        """Update; return whether all joints have arrived, or one has a frozen encoder."""
        self.update()
        return bool((self.away <= self._tolerance).all()) or bool(self.unseen(_UNSEEN))

    def unseen(self, least: float) -> dict[int, float]:
        """Return the joints with frozen encoders whose motors turned them by ``least`` deg or more, with that way."""
        _, here, apart = self._farthest
        seen, turned = np.abs(self._here[self._joints] - here), np.abs(self._apart[self._joints] - apart)
        rows = zip(self._joints, seen.tolist(), turned.tolist(), strict=True)
        return {joint: far for joint, near, far in rows if far > least and near < _SEEN_SHARE * far}

    def late(self, part: Part) -> dict[int, Outcome]:
        """Return the outcomes of the joints that have not arrived."""
        rows = zip(self._joints, self._here[self._joints].tolist(), self._wanted.tolist(), strict=True)
        return {
            joint: Outcome(
                f"does not reach {part.shown(joint, goal, '.1f')} in time; it is at {part.shown(joint, where, '.1f')}",
                ("does not move",),
                limp=limpness(part, joint),
            )
            for joint, where, goal in rows
            if not abs(where - goal) <= self._tolerance
        }
