"""Position control accuracy: the step responses of joints in direct position mode."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rtf.robot.control_modes import ControlMode
from rtf.robot.interfaces import PidType
from rtf.robot_testing import Safety
from rtf.robot_testing.judging.friction_hold import friction_reach
from rtf.robot_testing.judging.step_response import STEADY_SHARE
from rtf.robot_testing.step_test import StepTest
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray, Pid
    from rtf.robot_testing import Trace
    from rtf.robot_testing.motion.routines import Routine
    from rtf.robot_testing.step_test import Cycle

#: The peak speed of a step's response, by the height of the step, 1/s: that of a critically damped loop of 10 Hz, as
#: fast as those of robots are, is ``w / e``. A joint that cannot be so fast would show the limits of its motor.
_PEAK_SPEED = 2 * math.pi * 10.0 / math.e


class PositionControlAccuracy(StepTest):
    """Steps each joint in direct position mode, several times; judges rise, overshoot, settling, error and spread.

    Before a step the joint is commanded to its current position for a while. The controller has the robot's gains, or
    those of the parameters; the robot's are restored afterwards. Slow joints have lower steps, which their greatest
    speed allows.
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
    # Gains are sent to the board unchanged, in the units of its firmware and its configuration.
    kp = Parameter(list[float], "proportional gain, in the board's units; none: the robot's", default=[], key="Kp")
    ki = Parameter(list[float], "integral gain, in the board's units; none: the robot's", default=[], key="Ki")
    kd = Parameter(list[float], "derivative gain, in the board's units; none: the robot's", default=[], key="Kd")

    repeatability = Parameter(
        float, "deviation of the steps from each other, at most; more if friction explains it", unit="deg",
        default=0.2, low=0.0,
    )  # fmt: skip
    # 2 % in the models of robots, 30 % more at rest, 30 % more of another unit, whose motor may give 8 % less torque.
    friction = Parameter(
        float, "friction of a joint, as a share of the greatest output of its controller", unit="%", default=3.7,
        low=0.0, high=100.0,
    )  # fmt: skip

    def setup(self) -> None:
        """Open the part, and set the gains of the parameters."""
        super().setup()
        names = self.robot_part.names
        fixed = [names[joint] for joint in self.chosen if not self.room(joint) > 0]
        self.assert_error_if_true(fixed, f"no room for a step: the limits of {', '.join(fixed)} leave no range")
        self._give_gains()
        board = self.robot_part.board
        self.pids = {joint: board.pid(PidType.POSITION, joint) for joint in self.chosen}
        self.hidden = {joint: self._hidden(pid, joint) for joint, pid in self.pids.items()}

    def _turning(self, joint: int) -> tuple[float, float]:
        """Return how fast the integral of a joint's controller turns round, and how wide friction may hold the joint.

        A joint that came from the other side, or went past its target, is held by an integral of the opposite sign. It
        stands until the error is ``width``, twice that whose proportional part is the friction. From there it follows
        the integral, and the error falls as ``width exp(-t / time)``; beyond the target it stands with an error of
        ``width / (1 + t / time)`` until ``t``. Returned are ``time`` (s) and ``width`` (deg),
        zeros without both parts.
        """
        pid = self.pids[joint]
        return (abs(pid.kp / pid.ki), 2.0 * friction_reach(pid, self.friction)) if pid.kp and pid.ki else (0.0, 0.0)

    def _hidden(self, pid: Pid, joint: int) -> float:
        """Return the standard deviation (deg) of the rest positions that friction allows a controller.

        Until its integral has grown, a joint rests anywhere in the interval in which the proportional part is less than
        the friction; the deviation of a uniform distribution is half its width by the root of three. Weak controllers,
        such as those of fingers, have wider intervals. At most a quarter of the step is allowed.
        """
        return min(friction_reach(pid, self.friction) / math.sqrt(3.0), self.room(joint) / 4)

    def most_rise(self, joint: int) -> float:
        """See StepTest: friction may hold the joint before the last tenth, for the rise time once more at most."""
        time, width = self._turning(joint)
        follows = time * math.log(max(width / (0.1 * self.room(joint)), 1.0))
        return self.rise_time + min(follows, self.rise_time)

    def most_settling(self, joint: int) -> float:
        """See StepTest: likewise beyond the band, on either side."""
        time, width = self._turning(joint)
        stands = time * max(width / min(self.band, self.room(joint) / 4.0) - 1.0, 0.0)
        return self.settling_time + min(stands, self.settling_time)

    def most_error(self, joint: int) -> float:
        """See StepTest: likewise in the middle of the time in which it is averaged."""
        time, width = self._turning(joint)
        averaged = (1.0 - STEADY_SHARE / 2.0) * (self.step_duration - self.lead)
        return max(self.steady_error, width * time / (time + averaged))

    def most_spread(self, joint: int, cycles: list[Cycle]) -> float:
        del cycles
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
        part = self.robot_part
        within = 0.5 * float(part.high[joint] - part.low[joint])
        return min(self.step, within, float(part.fastest[joint]) / _PEAK_SPEED)

    def begin(self, joint: int) -> Routine[tuple[float, float]]:
        part, (home, sign) = self.robot_part, self.starts[joint]
        self.assert_true(
            (yield from part.entering(ControlMode.POSITION_DIRECT, [joint])),
            f"{part.names[joint]} does not enter direct position mode: it stays in "
            f"{part.board.control_modes(joint)[0].word}",
        )
        return home, home + sign * self.room(joint)

    def drive(self, joint: int, command: float) -> None:
        self.robot_part.board.set_positions(command, joint)

    def measured(self, trace: Trace, joint: int) -> FloatArray:
        return trace.positions[:, joint]
