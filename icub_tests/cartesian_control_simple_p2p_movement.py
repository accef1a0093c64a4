"""Point-to-point reaching: a hand goes to a position in front of the robot, and back to its pose."""

from __future__ import annotations

import numpy as np

from rtf.robot_testing.cartesian_test import CartesianTest, wrong_target
from rtf.testing import Parameter

#: In front of the robot, a hand's width to the side of the arm: m, of the left arm.
_TARGET = (-0.4, -0.1, 0.0)
#: When the way back is stopped, in trajectory times.
_STOPPED = 0.4
#: Tolerance of a joint that the controller has to hold, deg.
_HELD = 1.0


class CartesianControlSimpleP2pMovement(CartesianTest):
    """Leads a hand by its Cartesian controller to a position with the torso, and back to its pose without.

    On the way back it is stopped, and goes on. Both reaches are judged by the controller's word, and by the encoders
    with the kinematics of the robot: what is left to the target, the duration, the speed, the delay of the poses, and
    limits. The limits of the controller have to be those of the boards, and the torso has to keep to those that it is
    given for the way back.
    """

    aliases = ("CartesianControlSimpleP2pMovementTest", "cartesian-control-simple-p2p-movement")
    tags = ("motion", "cartesian")

    target = Parameter(
        list[float], "where the hand goes; none: in front of the robot, on the side of the arm", unit="m", default=[]
    )

    def parameter_problems(self) -> list[str]:
        return [*super().parameter_problems(), *wrong_target(self, len(_TARGET))]

    def run(self) -> None:
        """Reach the position, then the pose of the start."""
        self.judge_limits()
        side = -1.0 if self.arm == "right" else 1.0
        target = np.array(self.target or _TARGET) * (1.0, 1.0 if self.target else side, 1.0)
        with self.asking():
            self.control.set_active_joints([True] * len(self.limb.chain))
        self.progress(0.1, "to the position")
        self.reach("to the position", target)
        torso = self.hold_torso()
        self.progress(0.5, "stopped")
        self.judge_controller_stop(
            lambda: self.control.go_to(self.starting_pose, self.time),
            lambda: self.control.desired().joints,
            _STOPPED * self.time,
        )
        self.progress(0.6, "back to the pose")
        self.reach("back to the pose", self.starting_pose)
        here = self.limb.positions()
        for joint in torso:
            name, wanted = self.limb.chain.joints[joint], self.starting_positions[joint]
            with self.subresult(name):
                self.measure("held", here[joint], "deg", wanted - _HELD, wanted + _HELD,
                             hint=f"{name} is not where the limits of {self.remote} hold it")  # fmt: skip

    def hold_torso(self) -> list[int]:
        """Let the controller move the joints of the torso to where they began, and nowhere else. Return them."""
        low, high = self.limb.limits
        held = [joint for joint, place in enumerate(self.limb.places) if not place.part.name.endswith("_arm")]
        start = np.clip(self.starting_positions, low, high)
        with self.asking():
            for joint in held:
                self.control.set_limits(joint, float(start[joint]), float(start[joint]))
        return held
