"""The shipped gaze controller on the simulated iCub, in lockstep: one robot for all tests."""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np
import pytest

from gaze_bench import EYES, ICUB, SimulatedGaze, random_point
from rtf import clock
from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import FixationPoint, SensorCategory, StereoPixels
from rtf.robot.kinematics import robot_chains
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)


@pytest.fixture(scope="module")
def robot() -> Iterator[SimulatedGaze]:
    """The robot and a client of its gaze controller."""
    with SimulatedGaze() as simulated:
        simulated.run(0.2)
        yield simulated


def test_random_points_are_looked_at(robot: SimulatedGaze):
    """Within 0.3 deg, by the encoders, soon after the motion is done."""
    generator = np.random.default_rng(7)
    for _ in range(6):
        point = random_point(generator)
        assert robot.look(point) < 3.0
        robot.run(0.1)
        assert robot.error(point) <= 0.3


def test_pixels_are_points(robot: SimulatedGaze):
    """Both eyes see the point at their pixels, and look at it."""
    robot.look(EYES.point_of((-10.0, 5.0, 5.0)))
    point = EYES.point_of((10.0, -5.0, 6.0))
    left, right = (tuple(robot.gaze.pixel_of(eye, point)) for eye in ("left", "right"))
    target = StereoPixels(left, right)
    assert robot.gaze.point_of(target) == pytest.approx(point, abs=1e-3)
    robot.gaze.look_at(target)
    assert robot.gaze.wait_motion_done(5.0, 0.02)
    for eye in ("left", "right"):
        assert robot.gaze.pixel_of(eye, point) == pytest.approx([159.5, 119.5], abs=2.5)


def test_the_reflex_keeps_a_point_while_the_torso_turns(robot: SimulatedGaze):
    """At 20 deg/s, to one side and back, also while it is accelerated: within 0.5 deg."""
    point = EYES.point_of((0.0, -5.0, 5.0))
    robot.gaze.set_tracking(True)
    robot.look(point)
    errors = []
    for period in range(75):
        robot.turn_torso((0.0, 0.0, 20.0 if period < 50 else -20.0))
        robot.run(0.02)
        errors.append(robot.error(point))
        if period == 50:
            assert robot.positions()[2] > 15.0
    robot.turn_torso((0.0, 0.0, 0.0))
    robot.gaze.set_tracking(False)
    robot.run(0.3)
    assert max(errors) <= 0.5


def test_the_sensor_turns_as_the_chain_says(robot: SimulatedGaze):
    """What the gyroscope feels of the torso is the rotation of the chain, in the axes of the sensor."""
    robot.turn_torso((0.0, 0.0, -15.0))
    robot.run(0.3)
    imu = robot_chains(ICUB).chain("head_imu", "2.5")
    felt = robot.boards["imu"].implementation.read_sensor(SensorCategory.GYROSCOPE, 0).values
    positions, torso, head = robot.positions()[:6], *(robot.boards[one].implementation for one in ("torso", "head"))
    speeds = np.concatenate([torso.encoder_speeds()[::-1], head.encoder_speeds()[:3]])
    wanted = imu.pose(positions)[:3, :3].T @ imu.jacobian(positions)[3:] @ speeds
    robot.turn_torso((0.0, 0.0, 0.0))
    robot.run(0.3)
    assert felt == pytest.approx(wanted, abs=1.5)


def test_a_joint_in_fault_ends_a_motion(robot: SimulatedGaze):
    """The eyes stop, targets are refused, and it works again afterwards."""
    point = EYES.point_of((-20.0, 0.0, 5.0))
    began = clock.current().now()
    robot.gaze.look_at(FixationPoint(point))
    robot.run(0.3)
    head = robot.boards["head"].implementation
    head.set_control_modes(ControlMode.IDLE, 2)
    robot.run(0.2)
    assert robot.gaze.motion_done()
    ended = ("motion-done", True)  # an event arrives by its own connection, at a time of its own
    eventually(
        lambda: [(event.name, event.time > began) for event in robot.events[-1:]] == [ended], "the end is not reported"
    )
    with pytest.raises(RefusedError):
        robot.gaze.look_at(FixationPoint(point))
    head.set_control_modes(ControlMode.POSITION, 2)
    robot.run(0.1)
    robot.look(point)
    robot.run(0.1)
    assert robot.error(point) <= 0.3
