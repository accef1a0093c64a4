"""The gaze controller on joints that do what they are told: points, saccades, ranges, tracking, reflexes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.robot.controllers.gaze import GazeMotion, GazeSettings
from rtf.robot.errors import RefusedError
from rtf.robot.kinematics import Eyes, robot_chains
from rtf.robot.model import load_robot

EYES = Eyes(*(robot_chains(load_robot("icub")).chain(name, "2.5") for name in ("left_eye", "right_eye", "head")))
LIMITS = ((-40, 30), (-20, 20), (-50, 50), (-30, 30), (-30, 30), (0, 90))
PERIOD = 0.01
#: What a jump of the eyes makes of its way in a period, deg.
JUMP = 10.0


class Head:
    """Joints that follow at once, with a torso that turns as it is told (deg/s)."""

    def __init__(self, **changes: object) -> None:
        self.controller = GazeMotion(EYES, LIMITS, period=PERIOD)
        self.controller.settings = replace(GazeSettings(saccades=False), **changes)
        self.positions = np.array([0.0] * 8 + [5.0])
        self.jump: np.ndarray | None = None
        self.events: list[tuple[float, str]] = []
        self.time = 0.0

    def run(self, seconds: float, torso: tuple[float, float, float] = (0, 0, 0), gyro: object = (0, 0, 0)) -> None:
        """Let some time pass."""
        for _ in range(round(seconds / PERIOD)):
            command = self.controller.step(self.positions, rotation=gyro, eyes_there=self.jump is None)
            self.events += [(round(self.time, 3), event) for event in command.events]
            self.positions[:3] += np.array(torso) * PERIOD
            if command.neck is not None:
                self.positions[3:6] = command.neck
            self.jump = command.saccade if command.saccade is not None else self.jump
            if self.jump is None:
                self.positions[6:] += command.eyes * PERIOD
            else:
                way = self.jump - self.positions[6:]
                self.positions[6:] += np.clip(way, -JUMP, JUMP)
                self.jump = None if np.abs(way).max() <= JUMP else self.jump
            self.positions[3:] = np.clip(self.positions[3:], *self.controller.limits.T)
            self.time += PERIOD

    def look(self, point: object, seconds: float = 3.0) -> None:
        """Look at a point, and let some time pass."""
        self.controller.look_at(point)
        self.run(seconds)

    def error(self, point: object) -> float:
        """The greater angle between an eye and a point, deg."""
        angles = []
        for pose in EYES.poses(self.positions):
            way = np.asarray(point) - pose[:3, 3]
            angles.append(np.degrees(np.arccos(min(1.0, way @ pose[:3, 2] / np.linalg.norm(way)))))
        return max(angles)


POINTS = st.tuples(st.floats(-40, 40), st.floats(-30, 25), st.floats(2.0, 12.0))


@settings(max_examples=12)
@given(POINTS, st.booleans())
def test_both_eyes_look_at_the_point(angles, saccades: bool):
    """Everywhere in front, within 0.3 deg once the motion is done; it is reported once, and then nothing moves."""
    point = EYES.point_of(angles)
    head = Head(saccades=saccades)
    head.look(point)
    names = [name for _, name in head.events]
    assert (names[0], names[-1]) == ("motion-onset", "motion-done")
    assert names.count("motion-done") == 1
    assert head.controller.done
    assert head.error(point) <= 0.3
    assert not head.controller.speeds.any()
    assert head.events[-1][0] < 1.6  # neck and eyes have 0.75 and 0.25 s


def test_eyes_are_faster_than_the_neck():
    """They look at the point long before the neck is there, and turn back as it comes."""
    head = Head()
    point = EYES.point_of((20, 10, 6))
    head.controller.look_at(point)
    head.run(0.45)
    assert head.error(point) < 2.0
    assert head.positions[7] > 5.0  # the version
    head.run(1.5)
    assert abs(head.positions[7]) < 1.0
    assert head.positions[5] == pytest.approx(-20, abs=3)  # the neck's yaw, positive to the left


def test_a_saccade_comes_first():
    """For points away from the axis, and not twice within its pause; the eyes jump to the point."""
    head = Head(saccades=True)
    point = EYES.point_of((15, 0, 6))
    head.controller.look_at(point)
    head.run(0.06)
    assert [name for _, name in head.events] == ["motion-onset", "saccade-onset", "saccade-done"]
    assert head.error(point) < 1.0
    head.controller.look_at(EYES.point_of((-15, 0, 6)))
    head.run(0.06)
    assert len(head.events) == 3
    head.look(EYES.point_of((-13, 0, 6)))
    near = head.events[3:]
    head.look(EYES.point_of((-8, 0, 6)))
    assert "saccade-onset" not in [name for _, name in head.events[3 + len(near) :]]


def test_ranges_and_tolerance_of_the_neck():
    """A bound joint stays in its range, a tolerance is left over; the eyes do the rest."""
    point = EYES.point_of((25, 0, 6))
    bound = Head(neck_ranges=((-5, 5), (0, 0), (-10, 10)))
    bound.look(point)
    assert bound.positions[5] == pytest.approx(-10, abs=0.5)  # a motion is done within that
    assert bound.error(point) <= 0.3
    short = Head(neck_tolerance=10.0)
    short.look(point)
    assert -17 < short.positions[5] < -13
    assert short.error(point) <= 0.3
    still = Head(neck_tolerance=30.0)
    still.look(point)
    assert still.positions[3:6] == pytest.approx([0, 0, 0])
    assert still.error(point) <= 0.3


def test_bound_eyes_look_straight_ahead():
    """The neck alone turns to the point."""
    head = Head(vergence=4.0)
    point = EYES.point_of((25, 10, 6))
    head.look(point)
    assert head.positions[6:] == pytest.approx([0, 0, 4], abs=0.15)
    pose = EYES.head_pose(head.positions)
    way = point - pose[:3, 3]
    assert way @ pose[:3, 2] / np.linalg.norm(way) == pytest.approx(1.0, abs=1e-4)


def test_a_point_out_of_reach_ends_at_the_limits():
    """As the original does, with a motion that is done."""
    head = Head()
    head.look((0.0, 0.0, 0.0))
    assert head.controller.done
    assert head.positions[3] == pytest.approx(-40, abs=0.6)


def test_tracking_follows_a_torso_that_turns():
    """Without it the head goes along after the motion is done."""
    point = EYES.point_of((0, 0, 6))
    for tracking in (True, False):
        head = Head(tracking=tracking)
        head.look(point)
        head.run(1.0, torso=(0, 0, 10))
        head.run(2.0)
        assert bool(head.error(point) <= 0.3) is tracking
        assert bool(head.error(point) > 5.0) is not tracking


#: The sign of the rotation about the axis of the root as the yaw of the torso grows.
_AHEAD = [EYES.head_pose([0, 0, yaw, *[0] * 5, 5])[:3, 2] for yaw in (0.0, 1.0)]
TURN = float(np.sign(np.cross(*_AHEAD)[2]))


def test_the_reflex_holds_the_eyes_while_the_head_is_turned():
    """A torso that turns at 20 deg/s, measured by the gyroscope: within 0.5 deg; without the reflex it is much more."""
    point = EYES.point_of((0, 0, 6))
    errors = {}
    for share in (0.0, 1.0):
        head = Head(tracking=True, vestibular=share, neck_tolerance=60.0)
        head.look(point)
        worst = 0.0
        for _ in range(40):
            head.run(0.02, torso=(0, 0, 20), gyro=(0.0, 0.0, TURN * np.radians(20)))
            worst = max(worst, head.error(point))
        errors[share] = worst
    assert errors[1.0] <= 0.5, errors
    assert errors[0.0] > 2.0, errors


def test_stop_ends_a_motion():
    """With its event; joints stay where they are."""
    head = Head()
    head.controller.look_at(EYES.point_of((20, 0, 6)))
    head.run(0.2)
    head.controller.stop()
    head.run(0.02)
    where = head.positions.copy()
    assert head.events[-1][1] == "motion-done"
    head.run(0.5)
    assert head.controller.done
    assert head.positions.tolist() == where.tolist()


def test_times_are_those_that_joints_can_have():
    """The eyes take at least 0.1 s, the neck 0.2 s more."""
    head = Head(eyes_time=0.01, neck_time=0.05)
    assert head.controller.settings.eyes_time == 0.1
    assert head.controller.settings.neck_time == pytest.approx(0.3)


def test_what_is_refused():
    """Points that are none, and limits that are none."""
    controller = GazeMotion(EYES, LIMITS)
    for wrong in ((1, 2), (float("nan"), 0, 0)):
        with pytest.raises(RefusedError, match="a point is three numbers"):
            controller.look_at(wrong)
    with pytest.raises(RefusedError, match="six pairs of limits"):
        GazeMotion(EYES, LIMITS[:5])
    with pytest.raises(RefusedError, match="six pairs of limits"):
        GazeMotion(EYES, [(1, 0)] * 6)
