"""The gaze controller on boards whose joints do what they are told: motions, events, settings, faults."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gaze_bench import EYES, ICUB
from rtf.bottle import Bottle, Property
from rtf.robot.control_modes import ControlMode
from rtf.robot.controllers.gaze import GazeSettings
from rtf.robot.devices.fake_board import FakeBoard, FakeDriver
from rtf.robot.errors import NoAnswerError, RefusedError, StaleStateError
from rtf.robot.gaze.controller import GazeController
from rtf.robot.gaze.views import EyeViews
from rtf.robot.interfaces import (
    ControllerEvent,
    FixationPoint,
    GazeAngles,
    MonoPixel,
    MonoPixelWithVergence,
    StereoPixels,
)
from rtf.robot.kinematics import Pinhole, pose_of, robot_chains

PERIOD = 0.01
HEAD = (*EYES.head.joints, "eyes_tilt", "eyes_version", "eyes_vergence")
LIMITS = {axis.name: (axis.minimum, axis.maximum) for axis in ICUB.axes}
CAMERA = Pinhole(320, 240, 300.0, 300.0, 160.0, 120.0)
IMU = robot_chains(ICUB).chain("head_imu", "2.5")


class Rig:
    """A board of nine joints, its time, a controller on it, and its events."""

    def __init__(self, *, sensed: bool = False, **changes: object) -> None:
        self.now = 0.0
        self.board = FakeBoard("head", driver=FakeDriver(lambda: self.now))
        low, high = (" ".join(str(LIMITS[name][side]) for name in HEAD) for side in (0, 1))
        self.board.open(
            Property.parse(f"(GENERAL (Joints 9) (AxisName {' '.join(HEAD)})) (LIMITS (Min {low}) (Max {high}))")
        )
        for joint in range(len(HEAD)):
            self.board.set_velocity_limits(joint, 0.0, 500.0)
        self.rotation = np.zeros(3)
        self.views = EyeViews(EYES, {"left": CAMERA, "right": CAMERA})
        self.controller = GazeController(
            self.board,
            self.views,
            settings=GazeSettings(**changes),
            gyroscope=self.feel if sensed else None,
            sensor_pose=IMU.pose if sensed else None,
        )
        self.events: list[ControllerEvent] = []
        self.controller.observe_events(self.events.append)

    def feel(self) -> np.ndarray:
        """What the gyroscope says; no numbers: its message is old."""
        if not len(self.rotation):
            raise StaleStateError("the message of the gyroscope is old")
        return self.rotation

    def run(self, seconds: float) -> None:
        """Let some time pass."""
        for _ in range(round(seconds / PERIOD)):
            self.now += PERIOD
            self.controller.publish(self.now)

    @property
    def names(self) -> list[str]:
        """The names of the events."""
        return [event.name for event in self.events]

    def look(self, point: object, seconds: float = 3.0) -> None:
        """Look at a point, and let some time pass."""
        self.controller.look_at(FixationPoint(point))
        self.run(seconds)

    def error(self, point: object) -> float:
        """The greater angle between an eye and a point, deg."""
        angles = []
        for pose in EYES.poses(self.controller.joints().values):
            way = np.asarray(point) - pose[:3, 3]
            angles.append(np.degrees(np.arccos(min(1.0, way @ pose[:3, 2] / np.linalg.norm(way)))))
        return max(angles)


POINT = EYES.point_of((20.0, -10.0, 6.0))
POINTS = st.tuples(st.floats(-40, 40), st.floats(-30, 20), st.floats(2.0, 12.0))


@settings(max_examples=8)
@given(POINTS, st.booleans())
def test_both_eyes_look_at_a_point(angles, saccades: bool):
    """Within 0.3 deg once the motion is done, and nothing moves any more; modes are those of the original."""
    rig = Rig(saccades=saccades)
    point = EYES.point_of(angles)
    rig.look(point, 4.0)
    assert rig.controller.motion_done()
    assert (rig.names[0], rig.names[-1]) == ("motion-onset", "motion-done")
    assert rig.error(point) <= 0.3
    seen = rig.controller.angles().values
    assert seen == pytest.approx(rig.controller.angles_of(point), abs=0.4)
    assert rig.board.control_modes() == (
        *[ControlMode.POSITION] * 3, *[ControlMode.POSITION_DIRECT] * 3, *[ControlMode.MIXED] * 3,
    )  # fmt: skip
    before = rig.controller.joints().values
    rig.run(0.5)
    assert rig.controller.joints().values == pytest.approx(before, abs=1e-6)
    assert not rig.controller.joint_velocities().any()


def test_events_of_a_motion():
    """Onset, saccade, checkpoints in their order, done."""
    rig = Rig()
    for share in (0.9, 0.5, 1.0):
        rig.controller.add_checkpoint(share)
    rig.look(POINT)
    assert rig.names == [
        "motion-onset", "saccade-onset", "saccade-done", *["motion-ongoing"] * 3, "motion-done",
    ]  # fmt: skip
    assert [event.checkpoint for event in rig.events[3:6]] == [0.5, 0.9, 1.0]
    times = [event.time for event in rig.events]
    assert times == sorted(times)


def test_targets_are_points():
    """Angles, also relative ones, pixels of one eye or of both are looked at as the points that they are."""
    rig = Rig()
    gaze = rig.controller
    point = np.array([-0.5, 0.1, 0.3])
    for make, accuracy in (
        (lambda left, right, depth: StereoPixels(tuple(left), tuple(right)), 1e-6),
        (lambda left, right, depth: MonoPixel("left", *left, depth), 1e-6),
        (lambda left, right, depth: MonoPixelWithVergence("left", *left, gaze.angles_of(point)[2]), 0.05),
        (lambda left, right, depth: GazeAngles(*gaze.angles_of(point)), 0.02),
    ):
        rig.look(POINT)
        left, right = gaze.pixel_of("left", point), gaze.pixel_of("right", point)
        eye = pose_of(gaze.pose("left").vector)
        target = make(left, right, float((point - eye[:3, 3]) @ eye[:3, 2]))
        meant = gaze.point_of(target)
        assert meant == pytest.approx(point, abs=accuracy)
        gaze.look_at(target)
        rig.run(3.0)
        assert rig.error(meant) <= 0.3
    left = gaze.pixel_of("left", point)
    relative = gaze.point_of(GazeAngles(5.0, 0.0, 0.0, relative=True))
    moved = gaze.angles_of(relative) - gaze.angles_of(gaze.point_of(GazeAngles(0.0, 0.0, 0.0, relative=True)))
    assert moved[0] == pytest.approx(5.0, abs=0.5)
    plane = (0.0, 0.0, 1.0, -point[2])
    assert gaze.point_on_plane("left", left, plane) == pytest.approx(point, abs=1e-6)


@pytest.mark.parametrize(
    "target",
    [
        FixationPoint([1.0, np.nan, 0.0]),
        MonoPixel("left", 160.0, 120.0, -1.0),
        MonoPixel("left", np.inf, 120.0, 1.0),
        StereoPixels((160.0, 120.0), (160.0, 120.0)),
    ],
)
def test_what_is_no_target_is_refused(target):
    """Numbers that are none, depths behind an eye, pixels with parallel rays."""
    rig = Rig()
    rig.run(0.1)
    with pytest.raises(RefusedError):
        rig.controller.look_at(target)
    assert rig.controller.motion_done()


def test_a_target_behind_the_head_ends_at_the_limits():
    """The motion is done, and all joints are within their limits."""
    rig = Rig()
    rig.look([0.5, 0.3, 0.3], 4.0)
    assert rig.controller.motion_done()
    for name, position in zip(HEAD, rig.controller.joints().values, strict=True):
        assert LIMITS[name][0] - 1e-6 <= position <= LIMITS[name][1] + 1e-6


def test_a_stop_ends_a_motion():
    """It is done at once; nothing moves from the next period on, also in a saccade."""
    for seconds in (0.03, 0.4):
        rig = Rig()
        rig.look(POINT, seconds)
        assert rig.controller.saccade_done() == (seconds > 0.1)
        rig.controller.stop()
        assert rig.controller.motion_done()
        rig.run(0.02)
        assert rig.names[-1] == "motion-done"
        before = rig.controller.joints().values
        rig.run(0.3)
        assert rig.controller.joints().values == pytest.approx(before, abs=0.05)


def test_a_stop_does_not_wait_for_a_look():
    """While a board does not answer: the stop returns, and the look that was asked for before does not begin."""
    rig = Rig()
    asked, answered = threading.Event(), threading.Event()
    modes = rig.board.control_modes

    def late(joints: object = None) -> tuple[ControlMode, ...]:
        asked.set()
        answered.wait(20)
        return modes(joints)

    rig.board.control_modes = late
    before = rig.board.encoders()
    with ThreadPoolExecutor(1) as pool:
        looking = pool.submit(rig.controller.look_at, FixationPoint(POINT))
        asked.wait(20)
        rig.controller.stop()
        answered.set()
        with pytest.raises(RefusedError, match="was stopped before the motion began"):
            looking.result(20)
    rig.run(0.2)
    assert rig.controller.motion_done()
    assert rig.events == []
    assert rig.board.encoders() == pytest.approx(before)


def test_tracking_keeps_a_point():
    """Also without a target: that where the eyes look; a torso that moves does not take them away."""
    rig = Rig(vestibular=1.0)
    rig.look(POINT)
    rig.controller.set_tracking(True)
    rig.board.set_control_modes(ControlMode.VELOCITY, [0, 1, 2])
    rig.board.velocity_move([0.0, 0.0, 15.0], [0, 1, 2])
    rig.run(1.0)
    assert rig.controller.joints().values[2] > 10.0
    assert rig.error(POINT) < 0.5
    rig.board.velocity_move([0.0, 0.0, 0.0], [0, 1, 2])
    rig.run(1.0)
    rig.controller.set_tracking(False)
    rig.run(0.1)
    assert not rig.controller.joint_velocities().any()
    idle = Rig()
    idle.run(0.1)
    idle.controller.set_tracking(True)
    idle.run(1.0)
    assert idle.controller.tracking()
    assert idle.controller.desired()[:3] == pytest.approx([0.0] * 3, abs=1.0)


def test_messages_of_a_gyroscope_may_be_late():
    """The encoders of the torso take its place for half a second, then the controller is suspended."""
    rig = Rig(sensed=True, vestibular=1.0)
    rig.look(POINT)
    rig.controller.set_tracking(True)
    rig.rotation = np.array([])
    rig.board.set_control_modes(ControlMode.VELOCITY, [0, 1, 2])
    rig.board.velocity_move([0.0, 0.0, 15.0], [0, 1, 2])
    rig.run(0.45)
    assert rig.error(POINT) < 0.5
    rig.rotation = np.zeros(3)
    rig.run(PERIOD)
    rig.rotation = np.array([])
    rig.run(0.45)
    assert rig.controller.status() == "running"
    with pytest.raises(StaleStateError):
        rig.run(0.1)
    assert rig.controller.status() == "suspended"


def test_stabilization_turns_the_head_against_a_rotation():
    """By the gyroscope; without one it is refused. It holds until it is switched off, and is reported."""
    with pytest.raises(RefusedError, match="without a gyroscope"):
        Rig().controller.set_stabilization(True)
    rig = Rig(sensed=True)
    rig.controller.set_stabilization(True)
    places = len(EYES.head)
    before = rig.controller.joints().values
    for _ in range(100):  # the torso is told to turn, and the sensor feels torso and neck
        positions, speeds = rig.controller.joints().values, np.zeros(places)
        speeds[2] = 10.0
        speeds[3:] = rig.controller.joint_velocities()[:3]
        felt = EYES.head.jacobian(positions[:places])[3:] @ speeds
        rig.rotation = IMU.pose(positions[:places])[:3, :3].T @ felt
        rig.run(PERIOD)
    turned = rig.controller.joints().values - before
    assert turned[5] == pytest.approx(9.0, abs=1.0)  # the neck's yaw: its sign is the other one
    rig.controller.set_stabilization(False)
    rig.rotation[:] = 0.0
    rig.run(0.1)
    still = rig.controller.joints().values
    rig.run(0.2)
    assert rig.controller.joints().values == pytest.approx(still, abs=1e-6)
    assert rig.names == ["stabilization-on", "stabilization-off"]


def test_contexts():
    """All settings are stored; context 0 is that of the start; deleting twice is no error."""
    rig = Rig()
    gaze = rig.controller
    gaze.set_neck_trajectory_time(1.5)
    gaze.bind_neck("yaw", -10.0, 100.0)
    gaze.bind_eyes(5.0)
    context = gaze.store_context()
    gaze.restore_context(0)
    assert (gaze.neck_trajectory_time(), gaze.neck_range("yaw"), gaze.blocked_vergence()) == (0.75, (-50, 50), None)
    gaze.restore_context(context)
    assert (gaze.neck_trajectory_time(), gaze.neck_range("yaw"), gaze.blocked_vergence()) == (1.5, (-10, 50), 5.0)
    gaze.delete_contexts([context, context, 0, 77])
    gaze.delete_contexts([context])
    with pytest.raises(RefusedError, match="no context"):
        gaze.restore_context(context)
    gaze.restore_context(0)


def test_settings_keep_to_what_is_possible():
    """Times are raised as by the original; a vergence below 0 is ignored; ranges in the wrong order are refused."""
    gaze = Rig().controller
    gaze.set_eyes_trajectory_time(0.01)
    assert gaze.eyes_trajectory_time() == 0.1
    gaze.set_neck_trajectory_time(0.01)
    assert gaze.neck_trajectory_time() == pytest.approx(0.3)
    gaze.bind_eyes(-1.0)
    assert gaze.blocked_vergence() is None
    gaze.bind_eyes(0.0)
    assert gaze.blocked_vergence() == EYES.smallest
    with pytest.raises(RefusedError, match="neck pitch is not 5 to -5"):
        gaze.bind_neck("pitch", 5.0, -5.0)
    with pytest.raises(RefusedError):
        gaze.set_vor_gain(float("nan"))
    with pytest.raises(RefusedError):
        gaze.set_stereo_options(Bottle())


@pytest.mark.parametrize("axis", ["pitch", "roll", "yaw"])
def test_a_blocked_neck_stands(axis):
    """The joint stays in its range, and the eyes look at the point; cleared, it may move again."""
    rig = Rig()
    place = 3 + ["pitch", "roll", "yaw"].index(axis)
    rig.controller.bind_neck(axis, 0.0, 0.0)
    point = EYES.point_of((12.0, -8.0, 6.0))
    rig.look(point)
    assert rig.controller.joints().values[place] == pytest.approx(0.0, abs=1e-6)
    assert rig.error(point) <= 0.3
    rig.controller.clear_neck(axis)
    assert rig.controller.neck_range(axis) == LIMITS[HEAD[place]]


def test_joints_in_fault_are_not_moved():
    """A target is refused by the joint's name; a motion ends within 0.1 s, with zero speeds of the eyes."""
    rig = Rig()
    rig.look(POINT, 0.4)
    rig.board.set_control_modes(ControlMode.IDLE, 5)
    with pytest.raises(RefusedError, match="neck_yaw is in mode IDLE"):
        rig.run(0.15)
    assert rig.controller.motion_done()
    assert rig.names[-1] == "motion-done"
    assert not rig.board.target_velocities([6, 7, 8]).any()
    with pytest.raises(RefusedError, match="neck_yaw is in mode IDLE"):
        rig.controller.look_at(FixationPoint(POINT))
    assert rig.controller.status() == "running"
    rig.board.set_control_modes(ControlMode.POSITION, 5)
    rig.look(POINT)
    assert rig.controller.motion_done()


@pytest.mark.parametrize("lost", [NoAnswerError("the board does not answer"), np.full(9, np.nan)])
def test_positions_that_are_lost_suspend_the_controller(lost, monkeypatch):
    """It reports so, refuses targets, stops the eyes, and runs again when it is told to."""
    rig = Rig()
    rig.look(POINT, 0.4)

    def encoders(*_: object) -> np.ndarray:
        if isinstance(lost, Exception):
            raise lost
        return lost

    with monkeypatch.context() as patch:
        patch.setattr(rig.board, "encoders", encoders)
        with pytest.raises(NoAnswerError):
            rig.run(0.05)
        assert rig.controller.motion_done()
        assert "comm-timeout" in rig.names
        with pytest.raises(RefusedError, match="suspended"):
            rig.controller.look_at(FixationPoint(POINT))
    assert not rig.board.target_velocities([6, 7, 8]).any()
    assert rig.controller.status() == "suspended"
    rig.run(0.5)
    rig.controller.resume()
    assert rig.names[-1] == "resumed"
    rig.look(POINT)
    assert rig.controller.motion_done()
    assert rig.error(POINT) <= 0.3


def test_another_program_may_take_the_head():
    """A motion ends, and the joints are left alone; the next one begins where they are, without a jump."""
    rig = Rig()
    rig.look(POINT, 0.4)
    rig.board.set_control_modes(ControlMode.POSITION, [3, 4, 5, 6, 7, 8])
    rig.board.position_move([0.0] * 6, [3, 4, 5, 6, 7, 8])
    with pytest.raises(RefusedError, match="another program has taken the head"):
        rig.run(0.15)
    assert rig.names[-1] == "motion-done"
    rig.run(2.0)
    assert rig.controller.joints().values[3:] == pytest.approx([0.0] * 6, abs=1e-6)
    rig.controller.look_at(FixationPoint(POINT))
    rig.run(0.02)
    assert rig.controller.joints().values[3:6] == pytest.approx([0.0] * 3, abs=0.1)
    rig.run(3.0)
    assert rig.error(POINT) <= 0.3


def test_suspended_it_leaves_the_joints_alone():
    """A motion ends, targets are refused, twice is the same as once."""
    rig = Rig()
    rig.look(POINT, 0.3)
    rig.controller.suspend()
    rig.controller.suspend()
    rig.run(0.02)
    assert rig.names[-2:] == ["suspended", "motion-done"]
    with pytest.raises(RefusedError, match="suspended"):
        rig.controller.stream_target(FixationPoint(POINT))
    rig.board.set_control_modes(ControlMode.POSITION, [3, 4, 5])
    rig.run(0.2)
    assert rig.board.control_modes([3, 4, 5]) == (ControlMode.POSITION,) * 3


def test_cameras_are_tweaked():
    """Their intrinsics; what is wrong is refused as a whole; an eye without a camera has no pixels."""
    gaze = Rig().controller
    matrix = [310.0, 0.0, 150.0, 0.0, 0.0, 305.0, 110.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    gaze.set_tweaks(Bottle([Bottle(["camera_intrinsics_left", Bottle(matrix)])]))
    tweaks = {one[0]: one[1] for one in gaze.tweaks()}
    assert tweaks["camera_intrinsics_left"].elements() == matrix
    assert tweaks["camera_width_right"] == 320
    for wrong in ("((camera_intrinsics_left (1 2)))", "((camera_width_left 100))", "(3)"):
        with pytest.raises(RefusedError):
            gaze.set_tweaks(Bottle.parse(wrong)[0])
    bare = EyeViews(EYES, {})
    with pytest.raises(RefusedError, match="CAMERA_CALIBRATION_RIGHT"):
        bare.pixel_of("right", [-0.5, 0.0, 0.3], np.zeros(9) + 1.0)


def test_info_describes_the_controller():
    """Pairs of keys and values, as the original's."""
    info = {one[0]: one[1] for one in Rig().controller.info()}
    assert info["min_allowed_vergence"] == EYES.smallest
    assert "saccade-done" in info["events"].elements()
