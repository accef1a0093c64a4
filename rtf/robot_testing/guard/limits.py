"""Limits of joints while a test moves them, and the error of a joint that violates one."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rtf.robot.errors import RobotError
from rtf.testing.verdict import TestFailure


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of a joint while a test moves it. None: no limit."""

    beyond: float = 5.0  # deg outside of its position limits
    #: Factor of the expected speed: the joint's greatest speed or, if less, twice the commanded speed, but at least
    #: 80 deg/s. Infinite: no limit.
    speed: float = 1.5
    current: float | None = 1.0  # factor of its greatest current; also, overloads of motors are watched
    torque: float | None = 1.5  # factor of the greatest torque of its motor: more has an external cause
    temperature: float | None = 1.0  # factor of its temperature limit
    pressing: bool = True  # whether joints are released that press, by the times of the robot's profile
    #: Greatest sudden change of the force at the part's sensor beyond what its motion explains, N. Chosen: a tenth of
    #: the 140 N that ISO/TS 15066 allows a robot to press on a hand, and more than the drift of strain gauges.
    contact: float | None = 15.0
    #: Whether all joints of a part are stopped when one goes into hardware fault: its board is lost, or has a reason.
    fault: bool = False


class GuardError(RobotError, TestFailure):
    """A joint violates a limit, and was stopped; the message names the joint, the value and the limit.

    The test fails, as the robot is at fault. It is inconclusive with an ``excuse``: this machine was too busy to
    control joints. ``joint`` is the number of the joint in the part, -1 if it is unknown. ``finding`` is the key of its
    likely causes. ``time`` is that of the violation, s of the robot's clock; infinite: just now. ``part_name`` is the
    prefix of the part's ports, "" if it is unknown.
    """

    def __init__(
        self,
        text: str,
        joint: int = -1,
        excuse: str = "",
        finding: str = "stopped",
        time: float = math.inf,
        part_name: str = "",
    ) -> None:
        super().__init__(text)
        self.joint = joint
        self.excuse = excuse
        self.finding = finding
        self.time = time
        self.part_name = part_name
