"""Reaching tolerance: a hand comes as near to a pose as its Cartesian controller is set."""

from __future__ import annotations

import math

import numpy as np

from rtf.robot_testing.cartesian_test import CartesianTest, wrong_target
from rtf.testing import Parameter

#: In front of the left arm: x, y, z (m), then the axis and the angle (rad) that turn the palm to the middle.
_TARGET = (-0.35, -0.1, 0.15, 0.0, math.sqrt(0.5), -math.sqrt(0.5), math.pi)


class CartesianControlReachingTolerance(CartesianTest):
    """Leads a hand to a pose with the torso at rest, and judges how near it comes, by controller and encoders.

    What is left, metres and radians in one norm, has to be within the tolerance that the controller is given: by its
    own word, and by the encoders with the kinematics of the robot. Then the hand goes back to its pose.
    """

    aliases = ("CartesianControlReachingToleranceTest", "cartesian-control-reaching-tolerance")
    tags = ("motion", "cartesian")

    tolerance = Parameter(
        float, "in-target tolerance: what is left, metres and radians in one norm", default=0.02, low=1e-4, high=0.2
    )
    timeout = Parameter(float, "time for a reach", unit="s", default=10.0, low=0.1)
    target = Parameter(
        list[float], "pose of the hand: x, y, z (m), axis and angle (rad); none: in front of the arm", default=[]
    )

    def parameter_problems(self) -> list[str]:
        return [*super().parameter_problems(), *wrong_target(self, len(_TARGET))]

    def run(self) -> None:
        """Reach the pose, then the pose of the start."""
        self.judge_limits()
        target = np.array(self.target or _TARGET)
        if not self.target and self.arm == "right":
            target[1] = -target[1]
        moving = [place.part.name.endswith("_arm") for place in self.limb.places]
        with self.asking():
            self.control.set_active_joints(moving)
        self.progress(0.1, "to the pose")
        self.reach("to the pose", target)
        with self.asking():
            self.control.stop()
        self.progress(0.6, "back")
        self.reach("back", self.starting_pose)
