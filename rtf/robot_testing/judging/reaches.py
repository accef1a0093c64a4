"""Reaches of a hand, judged by the controller's word and by the encoders: the end, the way, the time, the limits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.kinematics import pose_error, pose_of
from rtf.robot.kinematics.poses import POSITION
from rtf.robot_testing.judging.failure_causes import likely_causes
from rtf.robot_testing.judging.path_picture import path_picture

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot.interfaces.cartesian import CartesianSolution
    from rtf.robot_testing.judging.tip_motion import TipMotion
    from rtf.testing import TestCase

#: Joints count as beyond their limits from here on, and as touching them up to here, deg.
_BEYOND, _TOUCH = 0.5, 0.1
#: A joint of a solution is at its limit within this, deg.
_AT_LIMIT = 1.0
#: What a solver may leave of a pose within reach, mm and deg: that of the iCub keeps near its rest posture, too.
_SOLVED, _SOLVED_ORIENTATION = 3.0, 5.0


class Reach(NamedTuple):
    """A recorded reach: its target, a position (3,) or a pose (7,), the solution, when it was done (s from its start).

    ``reported`` (samples, 7) are the poses by the controller, ``seen`` (samples, 4, 4) those by the encoders. ``names``
    are the joints, ``low`` and ``high`` their limits (deg).
    """

    target: FloatArray
    solution: CartesianSolution
    done: float
    reported: FloatArray
    seen: FloatArray
    motion: TipMotion
    names: Sequence[str]
    low: FloatArray
    high: FloatArray

    @property
    def whole_pose(self) -> bool:
        """Whether the target has an orientation."""
        return self.target.size > POSITION

    @property
    def target_pose(self) -> FloatArray:
        """The target (4, 4); without an orientation, it has that of the root."""
        pose = pose_of(self.target) if self.whole_pose else np.eye(4)
        pose[:3, 3] = self.target[:3]
        return pose

    def left(self, pose: FloatArray, wanted: FloatArray) -> FloatArray:
        """Return what is left from a pose to another (m, rad): six numbers, the last three 0 if they do not count."""
        left = pose_error(wanted, pose)
        if not self.whole_pose:
            left[3:] = 0.0
        return left


class ReachBounds(NamedTuple):
    """What a reach has to keep to."""

    tolerance: float  # m and rad in one norm
    frame: tuple[float, float]  # mm and deg between the controller and the encoders
    duration: tuple[float, float]  # s
    lag: float  # s
    peak: float  # of the speed, by its mean


def judge_reach(test: TestCase, name: str, found: Reach, bounds: ReachBounds) -> None:
    """Judge a reach by the controller ``name``, the beginning of its ports."""
    solved = pose_of(found.solution.pose)
    _judge_solution(test, name, found, solved)
    _judge_rest(test, found, solved, bounds.tolerance)
    _judge_frame(test, name, found, bounds.frame)
    _judge_way(test, name, found, bounds)
    _judge_limits(test, found)


def _judge_solution(test: TestCase, name: str, found: Reach, solved: FloatArray) -> None:
    distance, angle = _sizes(found.left(solved, found.target_pose))
    hint = f"the solution of {name} misses the target; {likely_causes('unreachable')}"
    test.measure("solution from target", distance, "mm", high=_SOLVED, hint=hint)
    if found.whole_pose:
        test.measure("solution from target, orientation", angle, "deg", high=_SOLVED_ORIENTATION, hint=hint)


def _judge_rest(test: TestCase, found: Reach, solved: FloatArray, tolerance: float) -> None:
    for who, pose in (("the controller", pose_of(found.reported[-1])), ("the encoders", found.seen[-1])):
        distance, angle = _sizes(found.left(pose, found.target_pose))
        test.measure(f"position error by {who}", distance, "mm")
        if found.whole_pose:
            test.measure(f"orientation error by {who}", angle, "deg")
        left = float(np.linalg.norm(found.left(pose, solved)))
        hint = f"by {who} the hand rests {left:.4f} from the solution; {likely_causes('not in target')}"
        test.measure(f"left by {who}", left, "", high=tolerance, hint=hint)


def _judge_frame(test: TestCase, name: str, found: Reach, most: tuple[float, float]) -> None:
    distance, angle = _sizes(pose_error(found.seen[-1], pose_of(found.reported[-1])))
    text = f"{name} reports another pose than the encoders and the tables of the robot"
    hint = f"{text}; {likely_causes('hand frame')}"
    test.measure("controller from encoders", distance, "mm", high=most[0], hint=hint)
    test.measure("controller from encoders, orientation", angle, "deg", high=most[1], hint=hint)


def _judge_way(test: TestCase, name: str, found: Reach, bounds: ReachBounds) -> None:
    motion, (shortest, longest) = found.motion, bounds.duration
    causes = likely_causes("reach time" if found.done >= shortest else "reach too quick")
    hint = f"{name} has done the reach after {found.done:.2f} s; {causes}"
    test.measure("duration", found.done, "s", low=shortest, high=longest, hint=hint)
    hint = f"{name}/state:o is late; {likely_causes('controller late')}"
    most = None if math.isinf(bounds.lag) else bounds.lag
    test.measure("delay of the poses", motion.lag, "s", high=most, hint=hint)
    hint = f"the hand does not move in one sweep; {likely_causes('jerky reach')}"
    test.measure("peak of the speed by its mean", motion.peak_ratio, "", high=bounds.peak, hint=hint)
    test.measure("greatest speed", float(motion.speeds.max()), "m/s")
    test.measure("detour from the straight line", 1e3 * motion.detour, "mm")


def _judge_limits(test: TestCase, found: Reach) -> None:
    """Judge that no joint went beyond its limits, or touched one where neither its start nor its end is."""
    joints = found.motion.joints
    margins = found.motion.margins(found.low, found.high)
    ends = np.array([joints[0], found.solution.joints])
    away = np.minimum(ends - found.low, found.high - ends).min(axis=0)
    nearest = int(np.argmin(margins))
    hint = f"{found.names[nearest]} is beyond its limits; {likely_causes('beyond limit')}"
    test.measure("nearest to a limit", float(margins[nearest]), "deg", low=-_BEYOND, hint=hint)
    touched = (margins <= _TOUCH) & (away > _AT_LIMIT)
    for joint in map(int, np.flatnonzero(touched)):
        text = f"{found.names[joint]} touched a limit on the way, and begins and ends {away[joint]:.1f} deg from it"
        test.check_fail_if_true(condition=True, text=f"{text}; {likely_causes('touched limit')}")


def record_reach(test: TestCase, name: str, found: Reach) -> None:
    """Keep the errors over time, the speed, and a picture of the path."""
    solved = pose_of(found.solution.pose)
    left = np.array([found.left(pose, solved) for pose in found.seen])
    time = (found.motion.time, "s")
    test.record("error", time=time, position=(1e3 * np.linalg.norm(left[:, :3], axis=1), "mm"))
    if found.whole_pose:
        angles = np.degrees(np.linalg.norm(left[:, 3:], axis=1))
        test.record("error of the orientation", time=time, angle=(angles, "deg"))
    test.record("speed of the hand", time=time, speed=(found.motion.speeds, "m/s"))
    ways = {"by the encoders": found.motion.seen, "by the controller": found.motion.reported}
    test.attach(path_picture(ways, found.target[:3]), f"path {name}.png", "image/png")


def _sizes(left: FloatArray) -> tuple[float, float]:
    """Return what is left to a pose in mm and deg."""
    return 1e3 * float(np.linalg.norm(left[:3])), math.degrees(float(np.linalg.norm(left[3:])))
