"""Base class of tests of Cartesian controllers: a hand is led to poses, and judged by the encoders of the joints, too.

The controller is any server of the protocol, the iCub's or that of this project. Its word is compared with an own
forward kinematics of the joints' encoders, by the tables of the robot; neither knows the other.
"""

from __future__ import annotations

import math
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.errors import RefusedError, StaleStateError
from rtf.robot.interfaces import ICartesianControl
from rtf.robot.kinematics import robot_chains
from rtf.robot.model.errors import RobotModelError
from rtf.robot_testing.guard.safety import Safety
from rtf.robot_testing.judging.failure_causes import likely_causes
from rtf.robot_testing.judging.reaches import Reach, ReachBounds, judge_reach, record_reach
from rtf.robot_testing.judging.tip_motion import TipMotion
from rtf.robot_testing.motion.limb import Limb, LimbGuardError
from rtf.robot_testing.motion.part import PACE
from rtf.robot_testing.robot_name import robot_model
from rtf.robot_testing.task_test import TaskTest
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model import RobotModel
    from rtf.robot_testing import Part, Trace

#: Time for the first pose of the controller, s.
_FIRST_POSE, _LATEST_POSE = 0.1, 5.0
#: Time at rest after a reach before it is judged, s: the joints have caught up with their last command.
_REST = 0.4
#: The least duration of a reach, in trajectory times: shorter, and it has not kept to its time.
_SHORTEST = 0.75
#: Modes of joints that another program moves, or that are being calibrated.
_OTHER_MODES = frozenset({"pos", "vel", "torq", "ipwm", "icur", "cal"})
#: Limits that are the same, deg: those of a board may be rounded.
_SAME_LIMIT = 0.5


class CartesianTest(TaskTest[ICartesianControl]):
    """Leads a hand to poses by a Cartesian controller. ``setup`` connects to it, and stores its settings.

    A test calls ``reach``. The controller has the settings of its start meanwhile; its own are restored afterwards.
    """

    safety = Safety.MOTION

    arm = Parameter(
        str, "the arm whose hand is moved", default="left", choices=("left", "right"), aliases=("arm-type",)
    )
    controller = Parameter(
        str, "the beginning of its ports; none: /ROBOT/cartesianController/ARM_arm", default="", aliases=("remote",)
    )
    time = Parameter(float, "duration that is asked for a trajectory", unit="s", default=1.0, low=0.1, high=20.0)
    tolerance = Parameter(
        float, "in-target tolerance: what is left, metres and radians in one norm", default=0.01, low=1e-4, high=0.2
    )
    timeout = Parameter(float, "time for a reach", unit="s", default=5.0, low=0.1)
    # That of the iCub needs 1 to 1.45 trajectory times, by the tolerance.
    latest = Parameter(float, "greatest duration of a reach, in trajectory times", default=2.0, low=1.0)
    # Two periods of a state, and two of a controller, of 10 ms, and what lies between two boards.
    lag = Parameter(float, "greatest delay of the controller's poses", unit="s", default=0.04, low=0.0)
    frame = Parameter(float, "greatest distance of its pose from that of the encoders", unit="mm", default=1.0, low=0.0)
    frame_orientation = Parameter(float, "the same of the orientation", unit="deg", default=0.5, low=0.0)
    # A minimum jerk has 1.875, the filter of the iCub 2.1 until it is done; joints that stop on the way have more.
    peak = Parameter(float, "greatest peak of the speed, by its mean", default=3.0, low=1.0)
    joint_error = Parameter(float, "greatest error of a joint at rest", unit="deg", default=2.0, low=0.01)

    limb: Limb

    def subjects(self, robot: RobotModel) -> list[str]:
        with suppress(RobotModelError, RefusedError):
            return [*super().subjects(robot), *robot_chains(robot).chain(f"{self.arm}_arm", "2.5").joints]
        return super().subjects(robot)

    # Begin and end ---------------------------------------------------------------------------------------------------

    def setup(self) -> None:
        """Connect to the controller and to the parts of its joints, and begin with its settings of the start."""
        super().setup()
        self.remote = f"/{(self.controller or f'{self.robot_name}/cartesianController/{self.arm}_arm').strip('/')}"
        self.look_for("/rpc:i", "Cartesian controller", "start it, and its solver if that is a program")
        self.control = self.connect("cartesiancontrollerclient").view(ICartesianControl)  # type: ignore[type-abstract]  # it is only looked for
        self.limb = self._find_limb()
        self.starting_positions = self.limb.positions()
        with self.asking():
            self.starting_pose = self._first_pose()
            self.begin_settings()
            self.control.set_trajectory_time(self.time)
            self.control.set_tolerance(self.tolerance)

    def _find_limb(self) -> Limb:
        """Return the chain of the version that the controller names, on the parts of its joints."""
        info = self.controller_info()
        robot = robot_model(self)
        try:
            chain = robot_chains(robot).chain(f"{self.arm}_arm", info.get("arm_version", "1.0"))
            names = list(dict.fromkeys(robot.axis(joint).part for joint in chain.joints))
        except (RobotModelError, RefusedError) as error:
            self.assert_error(f"the kinematics of the {self.arm} arm are needed: {error}")
        return Limb(chain, [self.open_part(name) for name in names])

    def _first_pose(self) -> FloatArray:
        """Return the pose of the controller, once there is one. The test fails without one in five seconds."""
        end = self.now() + _LATEST_POSE
        while True:
            self.sleep(_FIRST_POSE)
            try:
                return self.control.pose().vector
            except StaleStateError as error:
                self.assert_fail_if_true(self.now() >= end, f"{self.remote}/state:o sends no poses: {error}")

    def judge_limits(self) -> None:
        """Judge the limits that the controller keeps to at its start: those of the boards."""
        low, high = self.limb.limits
        with self.asking():
            reported = [self.control.limits(joint) for joint in range(len(self.limb.chain))]
        for joint, name in enumerate(self.limb.chain.joints):
            with self.subresult(name):
                for what, value, own in (
                    ("lower", reported[joint][0], low[joint]),
                    ("upper", reported[joint][1], high[joint]),
                ):
                    self.check_fail_if_false(
                        abs(value - own) <= _SAME_LIMIT,
                        f"{name}: the {what} limit of {self.remote} is {value:.1f} deg, that of its board "
                        f"{own:.1f} deg; {likely_causes('controller limits')}",
                    )

    # Reaching --------------------------------------------------------------------------------------------------------

    def reach(self, name: str, target: Sequence[float] | FloatArray) -> None:
        """Lead the hand to a position (3,) or a pose (7,), and judge the reach in the sub-result ``name``.

        The test ends when the hand does not arrive.
        """
        with self.limb.recorded() as traces:
            try:
                found = self.follow(np.asarray(target, dtype=np.float64))
            except LimbGuardError as error:
                self.stop_controller()
                self.blame(error.part, error, "does not move", during=f"{name} by {self.remote}")
        self._judge_encoders(found, traces)
        with self.subresult(name):
            record_reach(self, name, found)
            bounds = ReachBounds(
                tolerance=self.tolerance,
                frame=(self.frame, self.frame_orientation),
                duration=(_SHORTEST * self.time, self.latest * self.time),
                lag=self.lag if not self.busy() else math.inf,
                peak=self.peak,
            )
            judge_reach(self, self.remote, found, bounds)

    def follow(self, target: FloatArray) -> Reach:
        """Command a reach, and sample it until a moment after it is done."""
        begin, done = self.now(), math.inf
        samples: list[tuple[float, FloatArray, FloatArray]] = []
        with self.asking():
            self.control.go_to(target, self.time)
            solution = self.control.desired()
            while (passed := self.now() - begin) < min(done + _REST, self.timeout + _REST):
                self.sleep(PACE)
                self.limb.watch()
                samples.append((self.now() - begin, self.control.pose().vector, self.limb.positions()))
                if math.isinf(done) and self.control.motion_done():
                    done = self.now() - begin
                if passed >= self.timeout and math.isinf(done):
                    break
        times, poses, joints = (np.array(column) for column in zip(*samples, strict=True))
        seen = self.limb.chain.pose(joints)
        motion = TipMotion(times, poses[:, :3], seen[:, :3, 3], joints)
        return Reach(target, solution, done, poses, seen, motion, self.limb.chain.joints, *self.limb.limits)

    # Judging ---------------------------------------------------------------------------------------------------------

    def _judge_encoders(self, found: Reach, traces: list[tuple[Part, Trace]]) -> None:
        """Judge the encoders after a reach; joints that another program has taken are its error, and not theirs."""
        done = math.isfinite(found.done)
        if not done:
            taken = self._taken_joints()
            self.stop_controller()
            self.assert_error_if_true(
                taken,
                f"{', '.join(taken)} left the mode of {self.remote}, or never entered it: another program or a "
                "calibration has taken it, or its board ignores requests for modes",
            )
        if done:
            self.judge_word(self._late(found, int(np.searchsorted(found.motion.time[:-1], found.done))))
        self.judge_encoders(
            self._late(found, -1),
            traces,
            "" if done else f"{self.remote} has not reached its target in {self.timeout:g} s",
            "all joints are where its solution has them",
        )

    def _taken_joints(self) -> list[str]:
        """Return the active joints that another program controls, with their modes."""
        active = self.control.active_joints()
        return [
            f"{joint} ({mode.word})"
            for chosen, joint, (part, number) in zip(active, self.limb.joints, self.limb.places, strict=True)
            for mode in part.board.control_modes([number])
            if chosen and mode.word in _OTHER_MODES
        ]

    def _late(self, found: Reach, sample: int) -> dict[tuple[str, int], str]:
        """Return the joints that are not where the solution has them, by part and number, each with a sentence."""
        joints = found.motion.joints[sample]
        left = joints - found.solution.joints
        return {
            (part.name, number): f"{name} is at {joints[joint]:.1f} deg, and "
            f"{found.solution.joints[joint]:.1f} deg are the solution"
            for joint, (name, (part, number)) in enumerate(zip(self.limb.chain.joints, self.limb.places, strict=True))
            if abs(left[joint]) > self._allowed(joint)
        }

    def _allowed(self, joint: int) -> float:
        """Return the error (deg) of a joint that the in-target tolerance allows, or the parameter if that is more."""
        column = np.linalg.norm(self.limb.chain.jacobian(self.limb.positions())[:, joint])
        allowed = math.degrees(2.0 * self.tolerance / float(column)) if column else math.inf
        return max(self.joint_error, allowed)


def wrong_target(test: CartesianTest, size: int) -> list[str]:
    """Return what is wrong with the parameter ``target``: it has so many numbers, or none."""
    given = test.parameter_values()["target"]
    if len(given) in (0, size):
        return []
    return [f"target: has {len(given)} values, must have {size} ({test.parameter_source('target')})"]
