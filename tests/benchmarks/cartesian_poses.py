"""A test that measures reaches of random poses by a Cartesian controller; see ``run_cartesian_benchmarks.py``."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.kinematics import pose_error, pose_of, vector_of
from rtf.robot_testing.cartesian_test import CartesianTest
from rtf.robot_testing.motion.limb import LimbGuardError
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.judging.reaches import Reach

#: Where hands go: x, y away from the middle on the side of the arm, z (m).
LOW, HIGH = np.array([-0.50, 0.0, -0.05]), np.array([-0.22, 0.35, 0.35])
#: Share of the ranges that postures are drawn from, in the middle.
MIDDLE = 0.9


class CartesianPoses(CartesianTest):
    """Reaches random poses one after the other, and records errors, speeds and limits."""

    poses = Parameter(int, "number of poses", default=200, low=1)
    seed = Parameter(int, "of the poses", default=1, low=0)
    time = Parameter(float, "of a trajectory", unit="s", default=1.5)
    tolerance = Parameter(float, "in-target tolerance", default=0.001)

    def run(self) -> None:
        """Reach all of them; one that is not done is a row of its own."""
        self.control.set_active_joints([True] * len(self.limb.chain))
        columns = dict.fromkeys(("duration", "position", "orientation", "solution", "peak", "speed", "margin"), "")
        with self.series("poses", number="count", **columns) as rows:
            for number, target in enumerate(self.targets()):
                try:
                    found = self.follow(vector_of(target))
                except LimbGuardError as error:
                    self.report(f"pose {number}: {error}")
                    self.control.stop()
                    for part in self.limb.parts:
                        part.go_home()
                    continue
                rows.append(number, *self.figures(found, target))

    def targets(self) -> list[FloatArray]:
        """Return poses of random postures within limits and constraints, in front of the robot."""
        generator, chain, found = np.random.default_rng(self.seed), self.limb.chain, []
        low, high = self.limb.limits
        side = np.array([1.0, 1.0 if self.arm == "right" else -1.0, 1.0])
        while len(found) < self.poses:
            posture = (low + high) / 2 + MIDDLE * generator.uniform(-0.5, 0.5, len(chain)) * (high - low)
            pose = chain.pose(posture)
            place = pose[:3, 3] * side
            if not chain.violations(posture) and (place >= LOW).all() and (place <= HIGH).all():
                found.append(pose)
        return found

    def figures(self, found: Reach, target: FloatArray) -> list[float]:
        """Return duration (s), errors at rest by the encoders (mm, deg), that of the solution (mm), and the way."""
        left = pose_error(target, found.seen[-1])
        solved = np.linalg.norm(target[:3, 3] - pose_of(found.solution.pose)[:3, 3])
        margins = found.motion.margins(found.low, found.high)
        ends = np.array([found.motion.joints[0], found.solution.joints])
        away = np.minimum(ends - found.low, found.high - ends).min(axis=0)
        return [
            found.done,
            1e3 * float(np.linalg.norm(left[:3])),
            math.degrees(float(np.linalg.norm(left[3:]))),
            1e3 * float(solved),
            found.motion.peak_ratio,
            float(found.motion.speeds.max()),
            float(margins[away > 1.0].min()),
        ]
