"""Stress of a gaze controller: targets that follow each other, whether the last motion is done or not."""

from __future__ import annotations

import random

from rtf.robot.errors import RobotError
from rtf.robot.interfaces import FixationPoint
from rtf.robot_testing.gaze_test import GazeTest
from rtf.robot_testing.judging.failure_causes import likely_causes
from rtf.robot_testing.motion.limb import LimbGuardError
from rtf.robot_testing.motion.part import PACE
from rtf.testing import Parameter

#: Where the robot looks at the end, m, as the test of the iCub does.
_HOME = (-0.5, 0.0, 0.35)
_BROKEN = ("hwfa", "idl", "cfgn")


class GazeControllerStress(GazeTest):
    """Has the robot look at random points, each for a random time, and watches the modes of its joints meanwhile.

    A joint in fault, in idle or not configured ends the test. At the end the robot looks ahead, and that is judged as
    a motion.
    """

    aliases = ("gazeController-stress", "gaze-controller-stress")
    tags = ("motion", "gaze", "stress")

    looks = Parameter(int, "points to look at", default=8, low=1, high=100000)
    ahead = Parameter(float, "distance of the points in front of the robot", unit="m", default=1.0, low=0.2)
    width = Parameter(float, "how far they are to the side, up and down at most", unit="m", default=1.0, low=0.0)
    shortest = Parameter(float, "least time for a point", unit="s", default=0.5, low=0.0)
    longest = Parameter(float, "greatest time for a point", unit="s", default=3.0, low=0.0)
    seed = Parameter(int, "of the random numbers", default=1)

    def run(self) -> None:
        """Look at the points, then ahead."""
        numbers = random.Random(self.seed)  # noqa: S311 - points, not secrets
        for number in range(self.looks):
            self.progress(number / (self.looks + 1), f"point {number + 1}")
            point = (-self.ahead, *(numbers.uniform(-self.width, self.width) for _ in range(2)))
            with self.asking():
                self.control.look_at(FixationPoint(point))
            self._watch(numbers.uniform(self.shortest, max(self.shortest, self.longest)), f"point {number + 1}")
        self.look("ahead", _HOME)

    def _watch(self, seconds: float, during: str) -> None:
        """Watch joints and modes for a time."""
        end = self.now() + seconds
        while self.now() < end:
            self.sleep(PACE)
            try:
                self.limb.watch()
            except LimbGuardError as error:
                self.stop_controller()
                self.blame(error.part, error, "does not move", during=f"{during} by {self.remote}")
        for joint, (part, number) in zip(self.limb.joints, self.limb.places, strict=True):
            try:
                [mode] = part.board.control_modes([number])
            except RobotError as error:
                self.assert_fail(f"the modes of {part.name} cannot be read: {error}")
            self.assert_fail_if_true(
                mode.word in _BROKEN, f"{joint} is in {mode.word} while the robot looks; {likely_causes('stopped')}"
            )
