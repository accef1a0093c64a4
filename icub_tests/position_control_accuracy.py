"""Position control accuracy: how joints answer to a step of their direct position reference."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rtf.robot.control_modes import ControlMode
from rtf.robot.interfaces import PidType
from rtf.robot_testing import Safety
from rtf.robot_testing.step_test import StepTest
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray, Pid
    from rtf.robot_testing import Trace
    from rtf.robot_testing.routines import Routine


class PositionControlAccuracy(StepTest):
    """Steps each joint in direct position mode, several times; judges rise, overshoot, settling, error and spread.

    Before its step a joint is told for a while to be where it is, which is rest enough. The controller is the robot's,
    or has gains of the test's own: then they are put back afterwards.
    """

    aliases = ("positionControl-accuracy", "positionControlAccuracy", "PositionControl-accuracy")
    tags = ("motion", "control")
    safety = Safety.MOTION
    rest = 0.1

    sample_time = Parameter(
        float, "time between two commands", unit="s", default=0.02, low=0.001, high=0.1, key="sampleTime"
    )
    step_duration = Parameter(
        float, "when a cycle ends, counted from the beginning of the rest before the step", unit="s", default=2.0
    )
    # Gains go to the board as they are given: in what its firmware and its configuration reckon in.
    kp = Parameter(list[float], "proportional gain, in the board's units; none: the robot's", default=[], key="Kp")
    ki = Parameter(list[float], "integral gain, in the board's units; none: the robot's", default=[], key="Ki")
    kd = Parameter(list[float], "derivative gain, in the board's units; none: the robot's", default=[], key="Kd")

    repeatability = Parameter(
        float, "deviation of the steps from each other, at most; more where friction hides more", unit="deg",
        default=0.2, low=0.0,
    )  # fmt: skip
    friction = Parameter(
        float, "of the greatest output of a joint's controller, that friction may hide from it", unit="%", default=2.5,
        low=0.0, high=100.0,
    )  # fmt: skip

    def setup(self) -> None:
        """See the base; with gains of its own, give them to the controllers."""
        super().setup()
        names = self.robot_part.names
        fixed = [names[joint] for joint in self.chosen if not self.room(joint) > 0]
        self.assert_error_if_true(fixed, f"no room for a step: the limits of {', '.join(fixed)} leave no range")
        self._give_gains()
        board = self.robot_part.board
        self.hidden = {joint: self._hidden(board.pid(PidType.POSITION, joint)) for joint in self.chosen}

    def _hidden(self, pid: Pid) -> float:
        """How far apart (deg, standard deviation) a controller may leave a joint that friction holds.

        Until its integral has gathered, a joint may rest wherever the proportional part is less than the friction: for
        all that is known anywhere in an interval, whose deviation is half its width by the root of three. Weak
        controllers, as of fingers, leave more. It is no excuse for a quarter of the step.
        """
        reach = self.friction / 100.0 * abs(pid.max_output) / abs(pid.kp) if pid.kp else math.inf
        return min(reach / math.sqrt(3.0), self.step / 4)

    def most_spread(self, joint: int) -> float:
        return max(self.repeatability, self.hidden[joint])

    def _give_gains(self) -> None:
        board = self.robot_part.board
        wanted = {"kp": self.kp, "ki": self.ki, "kd": self.kd}
        own = {name: self.per_joint(name.title(), values, self.chosen) for name, values in wanted.items() if values}
        if not own:
            return
        for place, joint in enumerate(self.chosen):
            pid = board.pid(PidType.POSITION, joint)
            board.set_pid(PidType.POSITION, joint, pid._replace(**{name: gains[place] for name, gains in own.items()}))

    def room(self, joint: int) -> float:
        return min(self.step, 0.5 * float(self.robot_part.high[joint] - self.robot_part.low[joint]))

    def begin(self, joint: int) -> Routine[tuple[float, float]]:
        part, (home, sign) = self.robot_part, self.starts[joint]
        self.assert_true(
            (yield from part.entering(ControlMode.POSITION_DIRECT, [joint])),
            f"{part.names[joint]} does not enter direct position mode: it stays in "
            f"{part.board.control_modes(joint)[0].word}",
        )
        return home, home + sign * self.room(joint)

    def drive(self, joint: int, reference: float) -> None:
        self.robot_part.board.set_positions(reference, joint)

    def measured(self, trace: Trace, joint: int) -> FloatArray:
        return trace.positions[:, joint]
