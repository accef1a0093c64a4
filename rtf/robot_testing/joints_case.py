"""The test case of joints: some joints of one part, held stiffly at home before anything is done with them."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode
from rtf.robot_testing.case import RobotTest
from rtf.robot_testing.causes import likely_causes
from rtf.robot_testing.guard import GuardError
from rtf.robot_testing.parameter_checks import swapped_ends
from rtf.robot_testing.part import TOLERANCE
from rtf.robot_testing.positioning import hold, late_of_held
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.part import Part

#: What joints are brought home with, deg/s.
HOMING = 20.0


class JointsTest(RobotTest):
    """A test of joints of one part. ``setup`` opens it; ``robot_part`` and ``chosen`` are the part and its joints."""

    part = Parameter(str, "the part whose joints are tested", default="left_arm")
    joints = Parameter(list[int], "its joints; none: all", default=[])
    home = Parameter(
        list[float], "where they wait for their turn; none: where they are", unit="deg", default=[], aliases=("zero",)
    )

    robot_part: Part
    chosen: list[int]

    def check_parameters(self, folder: str) -> None:
        """See Declared. Ends that are swapped are told of and taken as they are, for files of old have such."""
        super().check_parameters(folder)
        self.parameter_warnings += (*swapped_ends(self),)

    def setup(self) -> None:
        """Open the part and choose its joints."""
        super().setup()
        self.robot_part = part = self.open_part(self.part)
        self.chosen = self.select(part, self.wanted_joints())
        if self.home:
            part.home[self.chosen] = self.per_joint("home", self.home, self.chosen)

    def wanted_joints(self) -> Sequence[int]:
        """The numbers of the joints to be tested; none: all."""
        return self.joints

    def by_joint(self, name: str, values: Sequence[float]) -> FloatArray:
        """The values of a parameter by the numbers of the joints; NaN for those that are not chosen."""
        every = np.full(self.robot_part.axes, np.nan)
        every[self.chosen] = self.per_joint(name, values, self.chosen)
        return every

    def names_of(self, joints: Sequence[int]) -> str:
        """Joints for a sentence."""
        return ", ".join(self.robot_part.names[joint] for joint in joints)

    def hold(self, joints: Sequence[int] | None = None) -> None:
        """Bring joints, all without any given, into stiff position mode. Ends as an error where one does not obey.

        Those that were given up are left alone.
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
        self.assert_error_if_true(wrong, f"{part.name} does not take position mode: {'; '.join(wrong)}")

    def bring_home(
        self, joints: Sequence[int] | None = None, *, speed: float = HOMING, tolerance: float = TOLERANCE
    ) -> None:
        """Hold joints that were not given up, and bring them home. Those that do not come fail, and are left out.

        So are those that the guard has to stop. Ends as an error where one does not come that is not tested.
        """
        self.calmly(lambda: self._come_home(joints, speed, tolerance))

    def _come_home(self, joints: Sequence[int] | None, speed: float, tolerance: float) -> None:
        part = self.robot_part
        held = part.held(joints)
        self.hold(held)
        late = late_of_held(part, held, part.home[held], speed=speed, tolerance=tolerance)
        if not late:
            return
        if part.guard is not None:
            part.guard.halt([*late])  # it presses no more against what may be in its way
        tested = {joint: f"{late[joint]}; {likely_causes('does not move')}" for joint in self.chosen if joint in late}
        self._exclude(tested, "does not come home")
        others = [text for joint, text in late.items() if joint not in tested]
        self.assert_error_if_true(others, "; ".join(others))

    def leave_out(self, error: GuardError) -> None:
        """Fail the joint that the guard had to stop, leave it without power, and choose it no more.

        Nor those that are coupled with it: boards have them idle together, and nothing can be said of them then. Raises
        the error again where it is of a joint that is not tested.
        """
        if error.joint not in self.chosen:
            raise error
        self.give_up(error.joint, f"{error}; {likely_causes('stopped')}", "had to be stopped", excuse=error.excuse)

    def give_up(self, joint: int, text: str, what: str, *, excuse: str = "") -> None:
        """Fail a joint with a text, leave it idle for ``what``, and choose it no more, nor those coupled with it.

        With an ``excuse`` nothing can be said of it.
        """
        guard = self.robot_part.guard
        if guard is not None:
            guard.give_up(joint, f"it {what}")
            guard.give_up_companions(joint, f"which {what}")
        self._exclude({joint: text}, what, excuse)

    def _exclude(self, wrong: Mapping[int, str], what: str, excuse: str = "") -> None:
        """Fail joints, and choose neither them any more, nor those that are coupled with them."""
        names, guard = self.robot_part.names, self.robot_part.guard
        for joint, text in wrong.items():
            self._fail(joint, text, excuse)
        coupled = {other: joint for joint in wrong for other in (guard.companions(joint) if guard is not None else ())}
        for other, joint in coupled.items():
            if other in self.chosen and other not in wrong:
                with self.subresult(names[other]):
                    self.inconclusive(f"{names[other]} is coupled with {names[joint]}, which {what}")
        self.chosen = [one for one in self.chosen if one not in wrong and one not in coupled]
        self.assert_fail_if_false(self.chosen, "no joint is left that could be tested")

    def _fail(self, joint: int, text: str, excuse: str) -> None:
        """Fail a joint; with an ``excuse`` nothing can be said of it."""
        with self.subresult(self.robot_part.names[joint]):
            if excuse:
                self.inconclusive(f"{text}; but {excuse}")
            self.check(condition=False, text=text)

    def judge_stop(self, joint: int, error: GuardError) -> None:
        """Fail the joint that the guard had to stop during the course of one; of that one nothing is said but this.

        Where it is another one, the joint of the course is held where it is.
        """
        part, stopped = self.robot_part, self.robot_part.names[error.joint]
        if error.joint != joint and part.guard is not None:
            part.guard.halt([joint])
        self._fail(error.joint, f"{error}; {likely_causes('stopped')}", error.excuse)
        if error.joint != joint:
            with self.subresult(part.names[joint]):
                self.inconclusive(f"{stopped} had to be stopped while {part.names[joint]} was tested")

    def calmly(self, act: Callable[[], object]) -> None:
        """Do something that takes time, again without the joints that had to be stopped meanwhile, see ``leave_out``.

        It is to go by ``chosen``. Fails where no joint is left.
        """
        while True:
            try:
                act()
            except GuardError as error:
                self.leave_out(error)
            else:
                return

    @contextmanager
    def guarded(self) -> Iterator[None]:
        """A joint that does what it may not is a failure of the robot: the test, or the sub-result, ends with it."""
        try:
            yield
        except GuardError as error:
            self.blame(error, "stopped")


def told_at(times: FloatArray, told: Sequence[tuple[float, float]]) -> FloatArray:
    """What a joint was told at such times: the values of commands, with the time of each in their order."""
    begins, values = np.array(told, dtype=np.float64).T
    latest: FloatArray = values[np.maximum(np.searchsorted(begins, times, side="right") - 1, 0)]
    return latest
