"""Base class of tests of gaze controllers: the eyes are led to points, and judged by the encoders of the joints, too.

The controller is any server of the protocol, ``iKinGazeCtrl`` of the iCub or that of this project. Its word is compared
with an own kinematics of the joints' encoders, by the tables of the robot; neither knows the other.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.errors import RefusedError, StaleStateError
from rtf.robot.interfaces import FixationPoint, IGazeControl
from rtf.robot.kinematics import Eyes, robot_chains
from rtf.robot.model.errors import RobotModelError
from rtf.robot_testing.judging.failure_causes import likely_causes
from rtf.robot_testing.motion.limb import JointGroup, LimbGuardError
from rtf.robot_testing.motion.part import PACE
from rtf.robot_testing.robot_name import robot_model
from rtf.robot_testing.task_test import TaskTest
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray, NeckAxis
    from rtf.robot_testing import Part, Trace

_AXES: tuple[NeckAxis, ...] = ("pitch", "roll", "yaw")
EYE_JOINTS = ("eyes_tilt", "eyes_version", "eyes_vergence")
#: Time for the first message of the controller, s.
_FIRST, _LATEST = 0.1, 5.0
#: Time at rest after a motion before it is judged, s: a controller may still settle.
_REST = 0.8


class Look(NamedTuple):
    """A recorded motion: its point, when it was done (s from its start; infinite if it was not), and its samples.

    ``reported`` (samples, 3) are the fixation points by the controller, ``joints`` (samples, 9) positions of torso and
    head (deg), of which ``wanted`` (6,) has where the controller wants the head.
    """

    point: FloatArray
    done: float
    times: FloatArray
    reported: FloatArray
    joints: FloatArray
    wanted: FloatArray

    @property
    def when_done(self) -> int:
        """The sample in which it was done."""
        return int(np.searchsorted(self.times[:-1], self.done))


class GazeTest(TaskTest[IGazeControl]):
    """Leads the eyes to points by a gaze controller. ``setup`` connects to it, and stores its settings.

    A test calls ``look``. The controller has the settings of its start meanwhile; its own are restored afterwards.
    """

    controller = Parameter(str, "the beginning of its ports", default="/iKinGazeCtrl", aliases=("remote",))
    timeout = Parameter(float, "time for a motion", unit="s", default=5.0, low=0.1)
    # The controller of the iCub ends a motion with 0.1 deg of the eyes and 0.5 deg of the neck, which eyes make up for.
    tolerance = Parameter(
        float, "greatest angle between an eye and its point at rest", unit="deg", default=0.7, low=0.0
    )
    latest = Parameter(float, "greatest duration of a motion", unit="s", default=3.0, low=0.1)
    frame = Parameter(
        float, "greatest angle between the fixation points by controller and encoders", unit="deg", default=0.5, low=0.0
    )
    joint_error = Parameter(float, "greatest error of a joint at rest", unit="deg", default=2.0, low=0.01)

    # Begin and end ---------------------------------------------------------------------------------------------------

    def setup(self) -> None:
        """Connect to the controller and to the parts of its joints, and begin with its settings of the start."""
        super().setup()
        self.remote = f"/{self.controller.strip('/')}"
        self.look_for("/rpc", "gaze controller", "start it, such as iKinGazeCtrl")
        self.control = self.connect("gazecontrollerclient").view(IGazeControl)  # type: ignore[type-abstract]  # it is only looked for
        self._find_joints()
        with self.asking():
            self.starting_point = self._first_point()
            self.begin_settings()

    def _find_joints(self) -> None:
        """Find the chains of the version that the controller names, and the parts of their joints."""
        version = self.controller_info().get("head_version", "1.0")
        robot = robot_model(self)
        try:
            tables = robot_chains(robot)
            left, right, head = (tables.chain(name, version) for name in ("left_eye", "right_eye", "head"))
            self.eyes = Eyes(left, right, head)
            joints = (*self.eyes.head.joints, *EYE_JOINTS)
            parts = dict.fromkeys(robot.axis(joint).part for joint in joints)
            self.limb = JointGroup(joints, [self.open_part(name) for name in parts])
        except (RobotModelError, RefusedError) as error:
            self.assert_error(f"the kinematics of the eyes are needed: {error}")

    def _first_point(self) -> FloatArray:
        """Return the fixation point of the controller, once there is one. The test fails without one in time."""
        end = self.now() + _LATEST
        while True:
            self.sleep(_FIRST)
            try:
                return self.control.fixation_point().values
            except StaleStateError as error:
                self.assert_fail_if_true(self.now() >= end, f"{self.remote}/x:o sends no points: {error}")

    # Looking ---------------------------------------------------------------------------------------------------------

    def look(self, name: str, point: Sequence[float] | FloatArray) -> None:
        """Look at a point (m), and judge the motion in the sub-result ``name``. The test ends if it is not done."""
        with self.limb.recorded() as traces:
            try:
                found = self._follow(np.asarray(point, dtype=np.float64))
            except LimbGuardError as error:
                self.stop_controller()
                self.blame(error.part, error, "does not move", during=f"{name} by {self.remote}")
        self._judge_encoders(found, traces)
        with self.subresult(name):
            self._judge(found)

    def _follow(self, point: FloatArray) -> Look:
        """Command a motion, and sample it until a moment after it is done."""
        begin, done = self.now(), math.inf
        samples: list[tuple[float, FloatArray, FloatArray]] = []
        with self.asking():
            self.control.look_at(FixationPoint(point))
            while (passed := self.now() - begin) < min(done, self.timeout) + _REST:
                self.sleep(PACE)
                self.limb.watch()
                samples.append((self.now() - begin, self.control.fixation_point().values, self.limb.positions()))
                if math.isinf(done) and passed > _FIRST and self.control.motion_done():
                    done = self.now() - begin
            wanted = self.control.desired()
        times, reported, joints = (np.array(column) for column in zip(*samples, strict=True))
        return Look(point, done, times, reported, joints, wanted)

    # Judging ---------------------------------------------------------------------------------------------------------

    def _judge(self, found: Look) -> None:
        errors = np.array([self._error(positions, found.point) for positions in found.joints])
        self.record("error", time=(found.times, "s"), angle=(errors, "deg"))
        hint = f"the eyes do not look at the point; {likely_causes('gaze')}"
        self.measure("eyes from the point", float(errors[-1]), "deg", high=self.tolerance, hint=hint)
        if math.isfinite(found.done):
            left = float(errors[found.when_done])
            hint = f"{self.remote} says too early that its motion is done; {likely_causes('not in target')}"
            self.measure("eyes from the point when it was done", left, "deg", high=2.0 * self.tolerance, hint=hint)
        hint = f"the motion was done after {found.done:.2f} s; {likely_causes('reach time')}"
        most = self.latest if not self.busy() else None
        self.measure("duration", found.done, "s", high=most, hint=hint)
        pairs = zip(found.reported, found.joints, strict=True)
        apart = np.array([self._apart(reported, positions) for reported, positions in pairs])
        hint = f"{self.remote} reports another fixation point than the encoders and tables of the robot"
        hint = f"{hint}; {likely_causes('gaze')}"
        self.measure("controller from encoders", float(apart[-1]), "deg", high=self.frame, hint=hint)
        self.measure("greatest difference on the way", float(apart.max()), "deg")

    def _error(self, positions: FloatArray, point: FloatArray) -> float:
        """Return the greater angle (deg) between an eye and a point."""
        return max(_angle(pose[:3, 2], point - pose[:3, 3]) for pose in self.eyes.poses(positions))

    def _apart(self, reported: FloatArray, positions: FloatArray) -> float:
        """Return the angle (deg) between the fixation points by the controller and by the encoders, from the head."""
        seen = positions.copy()
        seen[-1] = max(seen[-1], self.eyes.smallest)
        head = self.eyes.head_pose(seen)[:3, 3]
        return _angle(reported - head, self.eyes.fixation_point(seen) - head)

    def _judge_encoders(self, found: Look, traces: list[tuple[Part, Trace]]) -> None:
        """Judge the encoders after a motion."""
        done = math.isfinite(found.done)
        if done:
            self.judge_word(self._late(found, found.when_done))
        else:
            self.stop_controller()
        self.judge_encoders(
            self._late(found, -1),
            traces,
            "" if done else f"{self.remote} does not look at its point within {self.timeout:g} s",
            "all joints are where it wants them",
        )

    def _late(self, found: Look, sample: int) -> dict[tuple[str, int], str]:
        """Return the joints of the head that are not where the controller wants them, each with a sentence."""
        first = len(self.limb.joints) - len(found.wanted)
        return {
            (part.name, number): f"{name} is at {is_at:.1f} deg, and {self.remote} wants it at {wanted:.1f} deg"
            for name, (part, number), is_at, wanted in zip(
                self.limb.joints[first:],
                self.limb.places[first:],
                found.joints[sample][first:],
                found.wanted,
                strict=True,
            )
            if abs(is_at - wanted) > self.joint_error
        }

    def judge_ranges(self) -> None:
        """Judge the ranges of the neck at the start of the controller: the limits of the boards."""
        first = len(self.eyes.head) - 3
        for axis, name, (part, number) in zip(_AXES, self.limb.joints[first:], self.limb.places[first:], strict=False):
            with self.asking():
                reported = self.control.neck_range(axis)
            own = part.low[number], part.high[number]
            with self.subresult(name):
                for what, value, limit in zip(("lower", "upper"), reported, own, strict=True):
                    self.check_fail_if_false(
                        abs(value - limit) <= _SAME_LIMIT,
                        f"{name}: the {what} limit of {self.remote} is {value:.1f} deg, that of its board "
                        f"{limit:.1f} deg; {likely_causes('controller limits')}",
                    )


#: Limits that are the same, deg: those of a board may be rounded.
_SAME_LIMIT = 0.5


def _angle(one: FloatArray, other: FloatArray) -> float:
    """Return the angle between two directions, deg."""
    return math.degrees(math.atan2(float(np.linalg.norm(np.cross(one, other))), float(one @ other)))
