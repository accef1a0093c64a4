"""The test case of joints: some joints of one part, held stiffly at home before anything is done with them."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from rtf.robot.control_modes import ControlMode
from rtf.robot_testing.case import RobotTest
from rtf.robot_testing.guard import GuardError
from rtf.robot_testing.parameter_checks import swapped_ends
from rtf.robot_testing.part import TOLERANCE
from rtf.robot_testing.positioning import hold
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

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
        """Hold joints that were not given up, and bring them home. Ends as an error where one does not come."""
        part = self.robot_part
        chosen = part.held(joints)
        self.hold(chosen)
        arrival = part.move(part.home[chosen], chosen, speed=speed, tolerance=tolerance)
        self.require(arrival, "home", part, chosen, part.home[chosen])

    def leave_out(self, error: GuardError) -> None:
        """Fail the joint that the guard had to stop, leave it without power, and choose it no more.

        Nor those that are coupled with it: boards have them idle together, and nothing can be said of them then. Raises
        the error again where it is of a joint that is not tested.
        """
        part, joint = self.robot_part, error.joint
        if part.guard is None or joint not in self.chosen:
            raise error
        part.guard.give_up(joint, "it had to be stopped")
        with self.subresult(part.names[joint]):
            self.check(condition=False, text=str(error))
        for other, why in part.guard.give_up_companions(joint, "which had to be stopped").items():
            if other in self.chosen:
                with self.subresult(part.names[other]):
                    self.inconclusive(f"{part.names[other]} {why}")
        coupled = [joint, *part.guard.companions(joint)]
        self.chosen = [one for one in self.chosen if one not in coupled]

    def calmly(self, act: Callable[[], object]) -> None:
        """Do something that takes time, again without the joints that had to be stopped meanwhile, see ``leave_out``.

        It is to go by ``chosen``. Fails where no joint is left.
        """
        while True:
            try:
                act()
            except GuardError as error:
                self.leave_out(error)
                self.assert_fail_if_false(self.chosen, "no joint is left that could be tested")
            else:
                return

    @contextmanager
    def guarded(self) -> Iterator[None]:
        """A joint that does what it may not is a failure of the robot: the test, or the sub-result, ends with it."""
        try:
            yield
        except GuardError as error:
            self.assert_fail(str(error))
