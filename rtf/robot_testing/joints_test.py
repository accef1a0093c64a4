"""Base class of tests of the joints of one part. They are held in stiff position mode before the test proper."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import RobotError
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.guard.transmission import Transmission
from rtf.robot_testing.judging.blame import Evidence, Strength, accused
from rtf.robot_testing.judging.failure_causes import likely_causes
from rtf.robot_testing.motion.disturbance import disturbance
from rtf.robot_testing.motion.part import TOLERANCE
from rtf.robot_testing.motion.start_position import hold, late_evidence, late_held_joints
from rtf.robot_testing.motion.stop_evidence import stop_evidence
from rtf.robot_testing.parameter_checks import swapped_ends
from rtf.robot_testing.robot_test import RobotTest
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.motion.part import Part

#: Speed of moves to home, deg/s.
HOMING = 20.0


class JointsTest(RobotTest):
    """A test of joints of one part. ``setup`` opens the part as ``robot_part``, and sets ``chosen`` to its joints."""

    part = Parameter(str, "the part whose joints are tested", default="left_arm")
    joints = Parameter(list[int], "its joints; none: all", default=[])
    home = Parameter(
        list[float], "where they wait for their turn; none: where they are", unit="deg", default=[], aliases=("zero",)
    )

    robot_part: Part
    chosen: list[int]

    def check_parameters(self, folder: str) -> None:
        """See Declared. Swapped ends of a range are reported and accepted: old parameter files have them."""
        super().check_parameters(folder)
        self.parameter_warnings += (*swapped_ends(self),)

    def setup(self) -> None:
        """Open the part and choose its joints."""
        super().setup()
        self.robot_part = part = self.open_part(self.part)
        self.chosen = self.select(part, self.wanted_joints())
        if self.home:
            part.home[self.chosen] = self.per_joint("home", self.home, self.chosen)

    def read_transmission(self) -> Transmission:
        """Return the gearboxes and couplings of the part. The test ends with an error if they cannot be used."""
        try:
            return Transmission.read(self.robot_part.board)
        except RobotError as error:
            self.assert_error(f"{self.robot_part.name}: {error}")

    def wanted_joints(self) -> Sequence[int]:
        """Return the numbers of the joints to be tested; none: all."""
        return self.joints

    def by_joint(self, name: str, values: Sequence[float]) -> FloatArray:
        """Return the values of a parameter as an array over all joints; NaN for those that are not chosen."""
        every = np.full(self.robot_part.axes, np.nan)
        every[self.chosen] = self.per_joint(name, values, self.chosen)
        return every

    def names_of(self, joints: Sequence[int]) -> str:
        """Return the names of joints, separated by commas."""
        return ", ".join(self.robot_part.names[joint] for joint in joints)

    def hold(self, joints: Sequence[int] | None = None) -> None:
        """Bring joints, by default all, into stiff position mode. Excluded joints are left out.

        The test fails if a joint does not take the mode.
        """
        part = self.robot_part
        chosen = part.held(joints)
        hold(part, chosen)
        modes = part.board.control_modes(chosen)
        wrong = [
            f"{part.names[joint]} stays in {mode.word}"
            for joint, mode in zip(chosen, modes, strict=True)
            if mode is not ControlMode.POSITION
        ]
        if wrong:
            self.assert_fail(
                f"{part.name} does not take position mode: {'; '.join(wrong)}; {likely_causes('lost mode')}"
            )

    def bring_home(
        self, joints: Sequence[int] | None = None, *, speed: float = HOMING, tolerance: float = TOLERANCE
    ) -> None:
        """Hold joints that were not excluded, and move them home.

        A tested joint that does not arrive, or that the guard has to stop, fails and is excluded. The test ends with an
        error if another joint does not arrive.
        """
        self.retry_without_stopped(lambda: self._move_home(joints, speed, tolerance))

    def _move_home(self, joints: Sequence[int] | None, speed: float, tolerance: float) -> None:
        part = self.robot_part
        held = part.held(joints)
        self.hold(held)
        late = late_held_joints(part, held, part.home[held], speed=speed, tolerance=tolerance)
        if not late:
            return
        if part.guard is not None:
            part.guard.halt([*late])  # so that it does not push against an obstacle
        found, before = late_evidence(part, late), [*self.chosen]
        wrong = accused(found)
        doubtful = [joint for joint in late if joint in self.chosen and joint not in wrong]
        for joint in doubtful:
            complaint = Evidence.uncertain(joint, late[joint])
            self.judge_evidence(part, joint, complaint, found)
        self.chosen = [joint for joint in self.chosen if joint not in doubtful]
        tested = {joint: one.sentence for joint, one in wrong.items() if joint in self.chosen}
        self._exclude(tested, "does not reach home")
        self.fail_others(found, before)
        others = [text for joint, text in late.items() if joint not in (*tested, *doubtful)]
        self.assert_error_if_true(others, "; ".join(others))

    def exclude_stopped(self, error: GuardError) -> None:
        """Fail the joints that are to blame for a stop, leave them without power, and remove them from ``chosen``.

        One of which nothing more is known than that it was stopped later than another one is inconclusive, and so are
        the joints coupled with them: boards leave them idle together. Raises the error again if none of them is tested.
        """
        found = accused(stop_evidence(self.robot_part, error))
        tested = [joint for joint in found if joint in self.chosen]
        if not tested:
            raise error
        first = self.first_stop(self.robot_part, found[tested[0]])
        for joint in tested:
            if joint in self.chosen:
                one = found[joint]
                text = one.sentence if str(error) in one.text else f"{one.sentence} ({error})"
                later = f"it was disturbed: {first.text}" if one.is_explained_by(first, joint) else ""
                self.fail_and_exclude(joint, text, "had to be stopped", excuse=one.excuse or later)

    def fail_and_exclude(self, joint: int, text: str, what: str, *, excuse: str = "") -> None:
        """Fail a joint with ``text``, leave it idle because it ``what``, and exclude it and those coupled with it.

        With an ``excuse`` it ends as inconclusive.
        """
        guard = self.robot_part.guard
        if guard is not None:
            guard.exclude(joint, f"it {what}")
            guard.exclude_coupled(joint, f"which {what}")
        self._exclude({joint: text}, what, excuse)

    def _exclude(self, wrong: Mapping[int, str], what: str, excuse: str = "") -> None:
        """Fail joints, and remove them and those coupled with them from ``chosen``."""
        names, guard = self.robot_part.names, self.robot_part.guard
        for joint, text in wrong.items():
            self._fail(joint, text, excuse)
        coupled = {
            other: joint for joint in wrong for other in (guard.coupled_with(joint) if guard is not None else ())
        }
        for other, joint in coupled.items():
            if other in self.chosen and other not in wrong:
                with self.subresult(names[other]):
                    self.inconclusive(f"{names[other]} is coupled with {names[joint]}, which {what}")
        self.chosen = [one for one in self.chosen if one not in wrong and one not in coupled]
        self.assert_fail_if_false(self.chosen, "no joint is left to test")

    def _fail(self, joint: int, text: str, excuse: str) -> None:
        """Fail a joint in its sub-result; with an ``excuse`` it ends as inconclusive."""
        with self.subresult(self.robot_part.names[joint]):
            if excuse:
                self.inconclusive(f"{text}; but {excuse}")
            self.check(condition=False, text=text)

    def fail_others(self, evidence: Iterable[Evidence], tested: Sequence[int]) -> None:
        """Fail the joints beside those that are tested that certain or likely evidence accuses."""
        for one in evidence:
            for joint in sorted(one.joints - {*tested} if one.strength > Strength.UNCERTAIN else ()):
                with self.subresult(self.robot_part.names[joint]):
                    self.check(condition=False, text=one.sentence)

    def end_if_explained(self, joint: int) -> None:
        """End a joint as inconclusive that shares motors with one that is to blame for an earlier stop."""
        if text := self.explained(self.robot_part, joint):
            self.inconclusive(f"{self.robot_part.names[joint]} cannot be judged: {text}")

    def end_if_disturbed(self, joint: int, text: str) -> None:
        """End a joint as inconclusive whose value is wrong, as ``text`` says, if another one explains that."""
        if why := self.explained(self.robot_part, joint) or disturbance(self.robot_part, joint):
            self.inconclusive(f"{text}; but {why}")

    def judge_own_stop(self, joint: int, error: GuardError, say_first: Callable[[], object] = lambda: None) -> None:
        """Judge the stop of a motion during the routine of a joint, see ``judge_stop``; another joint is held, too."""
        part = self.robot_part
        if error.joint != joint and part.guard is not None:
            part.guard.halt([joint])
        self.judge_stop(part, joint, error, say_first=say_first)

    def retry_without_stopped(self, act: Callable[[], object]) -> None:
        """Call ``act``, and again after each GuardError without the joint that was stopped, see ``exclude_stopped``.

        ``act`` has to use ``chosen``. The test fails if no joint is left.
        """
        while True:
            try:
                act()
            except GuardError as error:
                self.exclude_stopped(error)
            else:
                return

    @contextmanager
    def guarded(self) -> Iterator[None]:
        """Turn a GuardError into a failure of the test, or of the sub-result, with its likely causes."""
        try:
            yield
        except GuardError as error:
            self.blame(self.robot_part, error)


def command_at(times: FloatArray, commands: Sequence[tuple[float, float]]) -> FloatArray:
    """Return the command in force at each of some times. ``commands`` are pairs of time and value, in their order."""
    begins, values = np.array(commands, dtype=np.float64).T
    latest: FloatArray = values[np.maximum(np.searchsorted(begins, times, side="right") - 1, 0)]
    return latest
