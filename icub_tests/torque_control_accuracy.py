"""Torque control accuracy: the response of the measured torque of joints to a step of its reference."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode
from rtf.robot_testing import Safety, likely_causes
from rtf.robot_testing.coupled_step_test import CoupledStepTest
from rtf.robot_testing.judging.checked_values import CheckedValue
from rtf.robot_testing.judging.step_response import largest
from rtf.robot_testing.robot_name import robot_model
from rtf.robot_testing.step_test import alike
from rtf.robot_testing.torque_control import greatest_torque, holding_torques, torque_joints
from rtf.robot_testing.torque_disturbance import motors_by_torques, torque_disturbance
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing import Part, Trace
    from rtf.robot_testing.motion.routines import Routine
    from rtf.robot_testing.step_test import Cycle

#: Time of measuring the torque that holds a joint, s.
_HOLDING = 0.2
#: What the torque constant of a healthy motor differs by from that which its board knows, as a share, at most: magnets
#: have tolerances of 10 %. By so much the torque that holds a joint is wrong until the loop has corrected it.
_TOLERANCE = 0.1
#: Greatest step, as a share of the greatest torque of its joint.
_WEAKEST = 0.1
#: Speed at which a joint is on its way, as a share of the greatest speed of its moves.
_ON_ITS_WAY = 0.05


class TorqueControlAccuracy(CoupledStepTest):
    """Steps the torque of each joint up and down from the torque that holds it, and judges the step response.

    Every other step goes down: what answers in one direction only is no torque control.
    A step ends early when the joint moves away: the joint is held again before it has moved far.
    """

    aliases = ("torqueControl-accuracy", "torqueControlAccuracy", "TorqueControl-accuracy")
    tags = ("motion", "control", "torque")
    safety = Safety.EFFORT
    torque_control = True
    symbol = "Nm"
    highest = 1.0
    both_signs = True
    shortest = 0.1
    late_finding = wrong_finding = "torque answer"

    step = Parameter(
        float,
        "height of the step; on the robot 1 at most, and a tenth of the greatest torque by the board",
        unit="Nm",
        default=0.5,
        low=0.01,
        high=5.0,
    )
    step_duration = Parameter(
        float, "when a cycle ends, counted from the beginning of the rest before the step", unit="s", default=0.8
    )
    lead = Parameter(float, "time in torque mode before the step", unit="s", default=0.3, low=0.1)
    travel = Parameter(float, "displacement after which a joint is held again", unit="deg", default=8.0, low=0.5)
    holding_error = Parameter(
        float, "before the step, at most; a tenth of what the motors of the joint carry if that is more", unit="Nm",
        default=0.2, low=0.0,
    )  # fmt: skip
    band = Parameter(
        float, "settling band about the target; a quarter of the step at most", unit="Nm", default=0.1, low=0.001
    )
    settling_time = Parameter(float, "until it stays in the band, at most", unit="s", default=0.2, low=0.001)
    rise_time = Parameter(float, "from a tenth to nine tenths, at most", unit="s", default=0.1, low=0.001)
    overshoot = Parameter(float, "beyond the target, at most", unit="%", default=15.0, low=0.0)
    steady_error = Parameter(
        float, "at the end, at most; no more than a quarter of the step", unit="Nm", default=0.1, low=0.0
    )
    ripple = Parameter(float, "deviation at the end, at most", unit="Nm", default=0.1, low=0.0)
    repeatability = Parameter(float, "deviation of the steps from each other, at most", unit="Nm", default=0.1, low=0.0)

    def setup(self) -> None:
        """See StepTest."""
        self._begins_at: dict[int, float] = {}  # deg, where each joint is when its step begins
        self._carried: dict[int, float] = {}  # Nm, what the motors of each joint carry of it together, at most
        super().setup()

    def choose(self, part: Part) -> list[int]:
        """Return the chosen joints, by default those with torque control."""
        return torque_joints(self, part, self.joints)

    def disturbed(self, joint: int) -> str:
        """See StepTest: a motor that it shares may give another torque."""
        motors = motors_by_torques(self.robot_part, self.transmission, joint)
        return torque_disturbance(self.robot_part, joint, motors)

    def room(self, joint: int) -> float:
        return min(self.travel, 0.5 * float(self.robot_part.high[joint] - self.robot_part.low[joint]))

    def begin(self, joint: int) -> Routine[tuple[float, float]]:
        """See StepTest: the step starts with the torque that holds the joint."""
        part, (home, sign) = self.robot_part, self.starts[joint]
        self._begins_at[joint] = home
        torques = yield from holding_torques(self, part, [joint], _HOLDING)
        held, step = float(torques[joint]), self.step
        carried = float(np.abs(self.transmission.by_motors(torques, joint)).sum())
        self._carried[joint] = max(carried, self._carried.get(joint, 0.0))
        most = greatest_torque(part.board, joint)
        if most is not None:
            # A joint with a weak motor is a light one: it would be too fast before its torque can be judged.
            step = min(step, _WEAKEST * most)
            self.assert_error_if_false(
                abs(held + sign * step) <= most,
                f"{part.names[joint]} is held by {part.shown_torque(joint, held)}: a step of "
                f"{part.shown_torque(joint, step, 'g')} leaves its range of {part.shown_torque(joint, most, 'g')}",
            )
        entered = yield from self.entering(joint, ControlMode.TORQUE, held, torques)
        self.assert_true(
            entered,
            f"{part.names[joint]} does not enter torque mode: it stays in {part.board.control_modes(joint)[0].word}; "
            f"{likely_causes('mode')}",
        )
        return held, held + sign * step

    def drive(self, joint: int, command: float) -> None:
        self.give(joint, command)

    def command(self, joints: list[int], efforts: list[float]) -> None:
        if len(joints) > 1:
            self.robot_part.board.set_reference_torques(efforts, joints)
        else:
            self.robot_part.board.set_reference_torques(efforts[0], joints[0])

    def begins(self, joint: int, elapsed: float) -> bool:
        """Begin earlier with a joint that is on its way: an error that is allowed can move a light one so far.

        Whether it is, is judged by the torques. The step makes a light joint nearly too fast within the time that is
        needed to judge it, and the speed it has before is added.
        """
        if elapsed < self.shortest or super().begins(joint, elapsed):
            return elapsed >= self.shortest
        part = self.robot_part
        moved, speed = abs(part.board.encoder(joint) - self.starts[joint][0]), abs(part.board.encoder_speeds(joint)[0])
        return moved > 0.5 * self.travel or speed > _ON_ITS_WAY * float(part.fastest[joint])

    def enough(self, joint: int, after: float) -> bool:
        """End the step of a joint that has moved far, or of one that became fast after it could be judged.

        A joint that its friction has just held may slide before the step: its way counts from where the step begins.
        """
        part, (home, _) = self.robot_part, self.starts[joint]
        here, before = part.board.encoder(joint), math.isnan(after)
        if before:
            self._begins_at[joint] = here
        if abs(here - (home if before else self._begins_at[joint])) > self.travel:
            return True
        return after > self.shortest and abs(part.board.encoder_speeds(joint)[0]) > part.fastest[joint]

    def measured(self, trace: Trace, joint: int) -> FloatArray:
        return trace.torques[:, joint]

    def sensor_noise(self, joint: int) -> float:
        """See StepTest: torque sensors have noise, as a share of the greatest torque of their joint."""
        robot, name = robot_model(self), self.robot_part.names[joint]
        return (
            robot.sensors.joint_torques.noise * robot.axes[robot.index[name]].max_torque if name in robot.index else 0.0
        )

    def most_spread(self, joint: int, cycles: list[Cycle]) -> float:
        """See StepTest: errors before the steps are judged by themselves; what they differ by, the steps differ by."""
        del joint
        return math.hypot(self.repeatability, *(float(np.std(_before(group), ddof=1)) for group in alike(cycles)))

    def values(self, joint: int, cycles: list[Cycle]) -> list[CheckedValue]:
        """See StepTest: add the error before the step."""
        before = [abs(error) for error in _before(cycles)]
        most = max(self.holding_error, _TOLERANCE * self._carried[joint])
        error = CheckedValue("error before the step", largest(before), "Nm", most, self.wrong_finding)
        return [error, *super().values(joint, cycles)]


def _before(cycles: list[Cycle]) -> list[float]:
    """Return the mean error before each step (Nm)."""
    return [float(one.measured[one.time < 0].mean()) - one.start for one in cycles]
