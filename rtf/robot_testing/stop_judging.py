"""How a robot test judges stops of the guard, and what it remembers of them: see ``judging/blame.py``."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, NoReturn

from rtf.robot.errors import RobotError
from rtf.robot_testing.judging.blame import Evidence, Strength, accused, blame, settle
from rtf.robot_testing.motion.stop_evidence import complaint_of_stop, stop_evidence
from rtf.testing import TestCase
from rtf.testing.verdict import Inconclusive, TestFailure

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from rtf.robot_testing.guard.limits import GuardError
    from rtf.robot_testing.motion.part import Part


class StopJudging(TestCase):
    """A test that judges stops of the guard by the evidence on all joints of a part, those before included."""

    _evidence: Mapping[str, list[Evidence]] = MappingProxyType({})  # certain and likely evidence of stops, by part
    _first_stops: Mapping[str, Evidence] = MappingProxyType({})  # the strongest evidence of the first stop, by part

    def judge_stop(
        self,
        part: Part,
        joint: int,
        error: GuardError,
        *findings: str,
        known: Sequence[Evidence] = (),
        say_first: Callable[[], object] = lambda: None,
    ) -> None:
        """Judge the stop of a motion by the guard while a joint was tested: see ``judging/blame.py``.

        Those to blame fail in sub-results of their own, whether they are tested or not. The joint itself, if it is not
        among them, is inconclusive, and others that are surely to blame are left without power: they would disturb the
        next ones, too. The first stop of a part explains later ones of other joints about which nothing more is known.
        ``findings`` are the keys of the likely causes of the joint; by default those of the guard. ``known`` is more
        evidence, and ``say_first`` is called before the joint fails: what a test knows better comes first.
        """
        found = [*stop_evidence(part, error, moved=joint), *known]
        self._note(part, joint, found)
        if part.guard is not None:
            part.guard.exclude_if_stopped_again(error.joint)
        wrong = accused(found)
        own = complaint_of_stop(joint, error, findings)
        first = self.first_stop(part, next(iter(wrong.values()), own))
        complaints = {joint: own, **{one: wrong[one] for one in wrong if one != joint}}
        for one, complaint in complaints.items():
            evidence = [first] if one in wrong and wrong[one].is_explained_by(first, one) else found
            if one == joint and blame(joint, complaint, evidence).failed:
                say_first()
            self.judge_evidence(part, one, complaint, evidence)

    def first_stop(self, part: Part, evidence: Evidence) -> Evidence:
        """Return the strongest evidence of the first stop of a part, which this is if there was none before.

        One that is no fault of the robot explains no later ones.
        """
        if not evidence.excuse:
            self._first_stops = {part.name: evidence, **self._first_stops}
        return self._first_stops.get(part.name, evidence)

    def _note(self, part: Part, joint: int, found: Sequence[Evidence]) -> None:
        """Remember certain and likely evidence, and exclude those whom it accuses beside a joint.

        The joint itself is excluded, too, if it has likely shaken the one that was stopped: it would shake the next.
        """
        strong = [one for one in found if one.strength > Strength.UNCERTAIN]
        self._evidence = {**self._evidence, part.name: [*self._evidence.get(part.name, []), *strong]}
        if part.guard is not None:
            for one, evidence in accused(strong).items():
                if one != joint or evidence.strength is Strength.LIKELY:
                    part.guard.exclude(one, "it does not obey its commands")
                    part.guard.exclude_coupled(one, "which was left without power")

    def judge_if_lost(self, part: Part, joint: int) -> bool:
        """Return whether a joint was excluded; judge it by what is known in that case.

        A joint that was stopped has failed or not by that; without evidence of its own it only cannot be tested.
        """
        if part.guard is None or not part.guard.is_excluded(joint):
            return False
        known = self._evidence.get(part.name, [])
        text = f"{part.names[joint]} was excluded and left without power"
        complaint = Evidence.uncertain(joint, text, "stopped")
        if known:
            self.judge_evidence(part, joint, complaint, known)
        else:
            with self.subresult(part.names[joint]):
                self.inconclusive(f"{text}: it cannot be tested")
        return True

    def explained(self, part: Part, joint: int) -> str:
        """Return what is known of joints that share motors with one: accused by an earlier stop, or without power.

        With it a value out of bounds is no fault of the joint. "" if there is nothing, or it is accused itself.
        """
        known = self._evidence.get(part.name, [])
        if part.guard is None or any(joint in one.joints for one in known):
            return ""
        sharing = part.guard.coupled_with(joint)
        limp = [part.names[one] for one in sharing if part.guard.is_excluded(one)]
        reasons = [f"it shares motors: {one.text}" for one in known if not one.joints.isdisjoint(sharing)]
        reasons += [f"it shares motors: {', '.join(limp)} had to be left without power"] if limp else []
        return reasons[0] if reasons else ""

    def judge_evidence(self, part: Part, joint: int, complaint: Evidence, found: Sequence[Evidence]) -> None:
        """Judge a joint by a complaint and the evidence on the joints of its part, in its sub-result."""
        with self.subresult(part.names[joint]):
            settle(self, blame(joint, complaint, found))

    def judged_stop(self, part: Part, error: GuardError) -> Exception:
        """Return the verdict on a stop that ends the test, or its sub-result, for which the test is not prepared."""
        try:
            self.blame(part, error)
        except (TestFailure, Inconclusive) as judged:
            return judged
        except RobotError as problem:
            self.warn(f"{part.name} does not tell whose fault a stop was: {problem}")
            return error

    def blame(
        self,
        part: Part,
        error: GuardError,
        *findings: str,
        joints: Sequence[int] = (),
        during: str = "",
        ends: bool = False,
    ) -> NoReturn:
        """End the test, or the sub-result, of joints that moved together, as the guard had to stop one of them.

        Without ``joints`` it is about all of the part. It fails if one of these is to blame, see ``judge_stop``. If the
        test ``ends`` by that, who is surely to blame gets no power on the way back.
        """
        found = stop_evidence(part, error)
        concerned = joints or range(part.axes)
        joint = next((one for one in accused(found) if one in concerned), concerned[0])
        if ends:
            self._note(part, -1, found)
        settle(self, blame(joint, complaint_of_stop(joint, error, findings, during), found))
