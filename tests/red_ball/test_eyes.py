"""Where a ball is by pictures of both eyes of the simulated robot."""

from __future__ import annotations

import math

import numpy as np
import pytest

from icub import ICUB, build_icub
from pictures import needs_pictures
from rtf.red_ball.detection import find_ball
from rtf.red_ball.eyes import cameras_of, in_root, pinhole
from rtf.robot.errors import RefusedError
from rtf.robot.kinematics import triangulated
from rtf.robot.model import load_robot
from rtf.robot.model.engine import mujoco
from rtf.simulator import ball as simulated
from rtf.simulator.cameras import Camera
from rtf.simulator.plant import Options
from rtf.simulator.simulation import Simulation

pytestmark = needs_pictures

RADIUS = 0.035


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    """A robot with eyes, and its ball."""
    return Simulation(build_icub(Options(cameras=True)))


def looking_about(random, place) -> dict[str, float]:
    """Positions (deg) with which head and eyes look near a place, and a torso that is turned."""
    x, y, z = place - np.array([-0.06, 0.0, 0.34])
    yaw, pitch = math.degrees(math.atan2(-y, -x)), math.degrees(math.atan2(z, math.hypot(x, y)))
    away = math.degrees(2 * math.atan(0.034 / math.sqrt(x * x + y * y + z * z)))
    return {
        "torso_yaw": random.uniform(-5, 5),
        "torso_pitch": random.uniform(-3, 5),
        "neck_yaw": 0.7 * yaw,
        "neck_pitch": max(0.7 * pitch, -35.0),
        "neck_roll": random.uniform(-5, 5),
        "eyes_tilt": 0.3 * pitch,
        "eyes_version": -0.3 * yaw,
        "eyes_vergence": random.uniform(0.7, 1.0) * away,
    }


class TestTwoEyes:
    """The place in the frame of the root."""

    def test_cameras_are_where_those_of_the_simulator_are(self, simulation: Simulation):
        """At home and in a pose, to a micrometre; z is ahead, y is down."""
        cameras = cameras_of(ICUB)
        plant, data = simulation.plant, simulation.data
        positions = {
            "neck_yaw": 20.0,
            "torso_pitch": 10.0,
            "eyes_tilt": -5.0,
            "eyes_version": 4.0,
            "eyes_vergence": 8.0,
        }
        axes = plant.home_axes.copy()
        for name, position in positions.items():
            axes[ICUB.index[name]] = math.radians(position)
        data.qpos[:] = plant.pose(axes)
        mujoco().mj_forward(plant.model, data)
        poses = cameras.eyes.poses([positions.get(joint, 0.0) for joint in cameras.joints])
        for pose, name in zip(poses, ("eyes_left", "eyes_right"), strict=True):
            camera = plant.model.camera(name).id
            np.testing.assert_allclose(pose[:3, 3], data.cam_xpos[camera], atol=1e-6)
            turn = data.cam_xmat[camera].reshape(3, 3)
            np.testing.assert_allclose(pose[:3, :3], turn @ np.diag([1.0, -1.0, -1.0]), atol=1e-6)
        simulation.reset()

    def test_ball_is_found_within_a_centimetre_over_the_reachable_places(self, simulation: Simulation):
        """Both eyes see it: within 5 mm by both, within 1 cm by the size in the left one."""
        cameras, camera = cameras_of(ICUB), pinhole(320, 240, 42.0)
        ball = simulated.find_ball(simulation)
        assert ball is not None
        plant, random = simulation.plant, np.random.default_rng(5)
        errors, by_size = [], []
        with (
            Camera(plant.model, "eyes_left", 320, 240) as left,
            Camera(plant.model, "eyes_right", 320, 240) as right,
        ):
            for _ in range(60):
                place = random.uniform([-0.45, -0.25, -0.1], [-0.22, 0.25, 0.35])
                axes = plant.home_axes.copy()
                for name, position in looking_about(random, place).items():
                    axes[ICUB.index[name]] = math.radians(position)
                simulation.data.qpos[:] = plant.pose(axes)
                mujoco().mj_forward(plant.model, simulation.data)
                ball.move(place)
                seen = [find_ball(one.render(simulation.data), camera, RADIUS) for one in (left, right)]
                if any(one is None or one.likelihood < 0.7 for one in seen):
                    continue  # an arm is before it
                poses = cameras.eyes.poses([math.degrees(axes[ICUB.index[joint]]) for joint in cameras.joints])
                found = triangulated([one.pixel for one in seen], [camera, camera], poses)
                errors.append(np.linalg.norm(found - place))
                by_size.append(np.linalg.norm(in_root(seen[0].place, poses[0]) - place))
        assert len(errors) > 45
        assert max(errors) < 0.005
        assert max(by_size) < 0.01
        simulation.reset()

    def test_robots_without_eyes_are_refused(self):
        """By the name of the camera that is missing."""
        with pytest.raises(RefusedError, match="has no camera 'left'"):
            cameras_of(load_robot("bench"))
